"""Stacks of panels: what the page's script draws, one stack a recording and kind of plot."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from escalator_twin.report.channels import channel_unit, display_scale
from escalator_twin.report.documents import Entry, Json, table, text
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
    """What a stack can be drawn over."""

    name: str
    label: str
    unit: str


# The path coordinate comes back where the chain has gone round once.
AXES = (
    Axis('time', 'time', 's'),
    Axis('travel', 'travel', 'm'),
    Axis('place', 'path coordinate of axle 0', 'm'),
)


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
                {'name': axis.name, 'label': axis.label, 'unit': axis.unit} for axis in self.axes
            ],
            'axis': self.first_axis,
            'grids': [
                {name: pack(x, name != 'place') for name, x in grid.items()} for grid in grids
            ],
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
    axes = tuple(axis for axis in AXES if all(axis.name in panel.x for panel in panels))
    first = 'travel' if any(axis.name == 'travel' for axis in axes) else 'time'
    return Stack(f'{entry.key}-signals', axes, first, tuple(panels))


def _signal_panel(channel: str, columns: Json) -> Panel | None:
    x = {axis.name: array(columns.get(f'{axis.name}_{axis.unit}')) for axis in AXES}
    y = {name: array(columns.get(name)) for name in DRAWN if columns.get(name)}
    n = len(x['time'])
    if not {'measured', 'simulated'} <= y.keys() or n < 2:
        return None
    if any(len(values) != n for values in y.values()) or not np.isfinite(x['time']).all():
        return None
    x = {name: way for name, way in x.items() if len(way) == n and np.isfinite(way).all()}
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
