"""What is left between the rig and the twin, both as designed: ``python -m rig floor BAG...``.

The bags are the twin's own, with ideal instruments; speed and loop position are fitted as for
any recording.  What is left is the error of one program or the other, no effect of a machine.
With ``--rails N`` what the rail may do stands beside it, of which the survey tells only so much:
the rig on N drawn rails against the rig on the likeliest one.
"""

from dataclasses import asdict, dataclass
import json
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray
from scipy.signal import periodogram

from rig.comparison import CHANNELS, channels_of, inside, NOISE, rate_of, TENSIONER, turned
from rig.draw import build, lay_rails, Tolerances
from rig.machine import Case
from rig.measured import read_measured
from rig.sheet import Sheet
from rig.travel import fit_travel, mean_speed, steady_loop
from rig.verify import follow

FloatArray = NDArray[np.float64]

SHOWN = tuple(name for name in CHANNELS if '/right' not in name)  # as designed, both sides agree
BANDS_HZ = ((0.0, 0.5), (0.5, 2.0), (2.0, 5.0), (5.0, 10.0), (10.0, 20.0))


@dataclass(frozen=True)
class Left:
    """One channel of one experiment, rms per band.

    Attributes
    ----------
    difference : twin less rig.
    rail : rig on a drawn rail less rig on the likeliest one; empty where none was drawn.
    signal : of the twin.
    noise : of the real sensor.
    """

    difference: tuple[float, ...]
    rail: tuple[float, ...]
    signal: tuple[float, ...]
    noise: tuple[float, ...]


def rounded(value: float) -> float:
    """Return a number to four digits: more tells nothing."""
    return float(f'{value:.4g}')


def band_rms(values: FloatArray, rate_hz: float) -> tuple[float, ...]:
    """Return the rms of a signal in each of ``BANDS_HZ``, its mean and trend removed."""
    frequency, density = periodogram(values, rate_hz, window='hann', detrend='linear')
    width = frequency[1]
    return tuple(
        rounded(np.sqrt(np.sum(density[(frequency > low) & (frequency <= high)]) * width))
        for low, high in BANDS_HZ
    )


def band_noise(channel: str) -> tuple[float, ...]:
    """Return the rms of the real sensor's white noise in each of ``BANDS_HZ``."""
    density = 2.0 * NOISE[channel] ** 2 / rate_of(channel)
    return tuple(rounded(np.sqrt(density * (high - low))) for low, high in BANDS_HZ)


def mean_square(parts: list[tuple[float, ...]]) -> tuple[float, ...]:
    """Return the root of the mean square over several rms values per band."""
    return tuple(map(rounded, np.sqrt(np.mean(np.square(parts), axis=0))))


def floor_of(bag: Path, draws: int = 0) -> tuple[Case, dict[str, Left]]:
    """Return the experiment of a bag of the twin, and what is left in it per channel."""
    measured = read_measured(bag)
    speed = mean_speed(measured, Sheet().pitch_m)
    model = build(Sheet(), measured.case, speed, Tolerances())
    likeliest = lay_rails(model, None)
    travel = fit_travel(measured, steady_loop(likeliest), speed)
    twin, said = channels_of(measured), follow(likeliest, travel, measured)
    rig = turned(twin, said)
    drawn = [
        follow(lay_rails(model, np.random.default_rng(k)), travel, measured) for k in range(draws)
    ]
    left = {}
    for name in CHANNELS:
        rate, part = rate_of(name), inside(name)
        rails = [band_rms((rows[name] - said[name])[part], rate) for rows in drawn]
        left[name] = Left(
            band_rms((twin[name] - rig[name])[part], rate),
            mean_square(rails) if rails else (),
            band_rms(twin[name][part], rate),
            band_noise(name),
        )
    return measured.case, left


def words(case: Case) -> str:
    """Return an experiment in words."""
    way = 'up' if case.direction > 0 else 'down'
    return f'{case.speed_m_s:g} m/s {way}, {case.load_kg:g} kg, {case.preload_n:g} N'


def table(found: list[tuple[Case, dict[str, Left]]]) -> list[str]:
    """Return the lines of a Markdown table: difference, drawn rails, (signal) per band."""
    heads = ' | '.join(f'{low:g}-{high:g} Hz' for low, high in BANDS_HZ)
    lines = [f'| experiment | channel | {heads} |', '|---' * (2 + len(BANDS_HZ)) + '|']
    for case, channels in found:
        for name in SHOWN:
            left, scale = channels[name], 1e3 if name == TENSIONER else 1.0
            rails = [f'; {value * scale:.2g}' for value in left.rail] or [''] * len(BANDS_HZ)
            cells = ' | '.join(
                f'{difference * scale:.2g}{rail} ({signal * scale:.3g})'
                for difference, rail, signal in zip(
                    left.difference, rails, left.signal, strict=True
                )
            )
            lines.append(f'| {words(case)} | `{name}` | {cells} |')
    scales = {name: 1e3 if name == TENSIONER else 1.0 for name in CHANNELS}
    for name in ('link_force/left_a', TENSIONER, 'step/acceleration/x'):
        cells = ' | '.join(f'{value * scales[name]:.2g}' for value in band_noise(name))
        lines.append(f'| noise of the real sensor | `{name.rpartition("/")[0]}` | {cells} |')
    return lines


def show_floor(bags: list[Path], out: Path | None, rails: int = 0) -> None:
    """Print the table of all bags; write the numbers, in SI units."""
    found = [floor_of(bag, rails) for bag in bags]
    print('\n'.join(table(found)))
    if out is not None:
        document = {
            'schema': 'rig/floor/1',
            'bands_hz': BANDS_HZ,
            'experiments': [
                {'case': asdict(case), 'channels': {n: asdict(c) for n, c in channels.items()}}
                for case, channels in found
            ],
        }
        text = json.dumps(document, indent=1)
        # a list of numbers on one line
        out.write_text(re.sub(r'\[[^][{}]*\]', lambda m: ' '.join(m[0].split()), text) + '\n')
