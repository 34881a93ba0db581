"""Stacks of panels: what the page's script draws, one stack a recording and kind of plot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from escalator_twin.report.channels import channel_unit, display_scale
from escalator_twin.report.documents import Entry, Json, number, table, text
from escalator_twin.report.series import array, band, largest, pack, spectrum
from escalator_twin.signals import Floats

BAND_HZ = 8.0  # of an overlay that does not say
DRAWN = ('simulated', 'extended', 'measured')  # from below to the top


@dataclass(frozen=True)
class Panel:
    """One channel's plot.

    Attributes
    ----------
    channel, unit : str
    x : mapping of axis to (n,) float64
        NaN-free.
    y : mapping of series to (n,) float64
        In ``unit``; NaN in gaps.
    is_log : bool
    has_residual : bool
        Draw measured minus simulated below.
    """

    channel: str
    unit: str
    x: dict[str, Floats]
    y: dict[str, Floats]
    is_log: bool = False
    has_residual: bool = False


@dataclass(frozen=True)
class Axis:
    """What a stack can be drawn over; ``origin`` names the axis that it is computed from."""

    name: str
    label: str
    unit: str
    origin: str = ''
    sign: int = 1
    offset: float = 0.0
    modulo: float | None = None


@dataclass(frozen=True)
class Stack:
    """Panels that are zoomed together."""

    key: str
    axes: tuple[Axis, ...]
    first_axis: str
    panels: tuple[Panel, ...]

    def packed(self) -> dict[str, Any]:
        """Return what the page's script reads."""
        grids: list[dict[str, Floats]] = []
        panels = []
        for panel in self.panels:
            panels.append(
                {
                    'channel': panel.channel,
                    'unit': panel.unit,
                    'grid': _grid(grids, panel.x),
                    'log': panel.is_log,
                    'residual': panel.has_residual,
                    'series': {name: pack(panel.y[name]) for name in DRAWN if name in panel.y},
                }
            )
        return {
            'axes': [
                {
                    'name': axis.name,
                    'label': axis.label,
                    'unit': axis.unit,
                    'from': axis.origin,
                    'sign': axis.sign,
                    'offset': axis.offset,
                    'modulo': axis.modulo,
                }
                for axis in self.axes
            ],
            'axis': self.first_axis,
            'grids': [{name: pack(x, True) for name, x in grid.items()} for grid in grids],
            'panels': panels,
        }


def _grid(grids: list[dict[str, Floats]], x: dict[str, Floats]) -> int:
    """Return the number of a grid; channels of one logger share theirs."""
    for i, grid in enumerate(grids):
        if grid.keys() == x.keys() and all(np.array_equal(grid[name], x[name]) for name in x):
            return i
    grids.append(x)
    return len(grids) - 1


def signal_stack(entry: Entry) -> Stack | None:
    """Return the overlays of a recording, ``None`` where its document has none."""
    overlay = table(entry.data.get('overlay'))
    panels = [
        panel
        for channel, columns in table(overlay.get('channels')).items()
        if (panel := _signal_panel(channel, table(columns))) is not None
    ]
    if not panels:
        return None
    axes = [Axis('time', 'time', 's')]
    if all('travel' in panel.x for panel in panels):
        axes.append(Axis('travel', 'travel', 'm'))
        axes += _place(entry.data, overlay, panels)
    return Stack(
        f'{entry.key}-signals', tuple(axes), axes[min(1, len(axes) - 1)].name, tuple(panels)
    )


def _place(data: Json, overlay: Json, panels: Sequence[Panel]) -> list[Axis]:
    """Return the axis of path coordinate: of axle 0, one loop where the loop's length is told."""
    start, way = number(data.get('start_s_m')), number(data.get('direction'))
    if start is None or way not in (-1.0, 1.0):
        return []
    sign = int(way)
    offset = start - sign * float(panels[0].x['travel'][0])
    loop = number(overlay.get('loop_m')) or number(data.get('loop_m'))
    return [Axis('place', 'path coordinate of axle 0', 'm', 'travel', sign, offset, loop)]


def _signal_panel(channel: str, columns: Json) -> Panel | None:
    x = {'time': array(columns.get('time_s')), 'travel': array(columns.get('travel_m'))}
    y = {name: array(columns.get(name)) for name in DRAWN if columns.get(name)}
    n = len(x['time'])
    if not {'measured', 'simulated'} <= y.keys() or n < 2:
        return None
    if any(len(values) != n for values in y.values()) or not np.isfinite(x['time']).all():
        return None
    if len(x['travel']) != n or not np.isfinite(x['travel']).all():
        del x['travel']
    unit = channel_unit(channel, text(columns.get('unit')))
    scale, shown = display_scale(largest(*y.values()), unit)
    return Panel(channel, shown, x, {k: v / scale for k, v in y.items()}, has_residual=True)


def spectrum_stack(entry: Entry, signals: Stack) -> Stack | None:
    """Return the amplitude spectra of a recording's overlays."""
    upper = band(table(entry.data.get('overlay')).get('band_hz'), BAND_HZ)
    panels = []
    for panel in signals.panels:
        lines = {name: spectrum(panel.x['time'], y, upper) for name, y in panel.y.items()}
        found = {name: line for name, line in lines.items() if line is not None}
        if not {'measured', 'simulated'} <= found.keys():
            continue
        x = {'frequency': found['measured'][0]}
        y = {name: line[1] for name, line in found.items()}
        scale, unit = display_scale(largest(*y.values()), panel.unit)
        y = {name: values / scale for name, values in y.items()}
        panels.append(Panel(panel.channel, unit, x, y, is_log=True))
    if not panels:
        return None
    axis = Axis('frequency', 'frequency', 'Hz')
    return Stack(f'{entry.key}-spectra', (axis,), 'frequency', tuple(panels))
