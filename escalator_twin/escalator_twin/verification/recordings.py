"""Another program: recordings of machines without deviation, by channel and frequency band.

They come from an independent multibody program of others, with the instrumentation's errors, and
from machines drawn within tolerance. The twin runs as the data sheet has it; nothing is fitted
but clocks, travel, and the accelerometer's bias and rotation.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from escalator_twin import bagfile
from escalator_twin.comparison.judge import Aligned, judge
from escalator_twin.comparison.locate import locate, RATE_HZ
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Floats
from escalator_twin.twin import make_simulation, run_twin
from escalator_twin.verification.figure import Figure

BANDS_HZ = ((0.0, 2.0), (2.0, 6.0), (6.0, 20.0))
# least correlation of the lowest band, by quantity
LEAST = {'link_force': 0.995, 'carriage_displacement': 0.995}
LEAST_AXIS = {'x': 0.995, 'z': 0.995}
EDGE_S = 2.0
FILTER_ORDER = 4


def aligned(machine: Machine, path: Path) -> dict[str, Aligned]:
    """Return every channel of a recording beside the twin's."""
    setting = locate(bagfile.read(str(path), machine), machine)
    trace = run_twin(
        make_simulation(machine, setting.experiment),
        machine.instruments.sensors,
        setting.start_s_m,
        setting.duration_s,
        RATE_HZ,
    )
    return dict(judge(setting, trace, machine).channels)


def in_band(row: Floats, rate_hz: float, low_hz: float, high_hz: float) -> Floats:
    """Return what of a signal lies in a band, its mean removed."""
    if low_hz == 0.0:
        sections = butter(FILTER_ORDER, high_hz, fs=rate_hz, output='sos')
    else:
        sections = butter(FILTER_ORDER, (low_hz, high_hz), 'bandpass', fs=rate_hz, output='sos')
    passed: Floats = sosfiltfilt(sections, row - row.mean())
    return passed


def band_agreement(one: Aligned, low_hz: float, high_hz: float) -> tuple[float, float]:
    """Return correlation and amplitude ratio, measured over simulated, within a band."""
    edge = round(EDGE_S * one.rate_hz)
    measured, simulated = (
        in_band(row, one.rate_hz, low_hz, high_hz)[edge:-edge]
        for row in (one.measured, one.simulated)
    )
    r = float(np.corrcoef(measured, simulated)[0, 1])
    return r, float(measured.std() / simulated.std())


def noise_alone(sensor: Sensor, one: Aligned, low_hz: float, high_hz: float) -> float:
    """Return the correlation of a band if white noise of the sensor were all that differs.

    With m = s + n and s, n independent it is std(s) / std(m); no sample of the twin enters it.
    """
    edge = round(EDGE_S * one.rate_hz)
    band = in_band(one.measured, one.rate_hz, low_hz, high_hz)[edge:-edge]
    field = sensor.noise**2 + sensor.resolution**2 / 12.0
    noise = field * sensor.scale**2 / len(sensor.fields) * 2.0 * (high_hz - low_hz) / one.rate_hz
    return float(np.sqrt(max(1.0 - noise / band.var(), 0.0)))


def figures(machine: Machine, paths: Sequence[Path] = ()) -> list[Figure]:
    """Return the figures of this page for recordings of good machines; none without any.

    Of channels of one quantity and direction, the one that agrees least.
    """
    found = []
    for path in paths:
        pairs = aligned(machine, path)
        for group, channels in _groups(machine).items():
            for low, high in BANDS_HZ:
                rows = [(*band_agreement(pairs[c], low, high), c) for c in channels if c in pairs]
                r, ratio, channel = min(rows)
                sensor = machine.instruments.sensor(channel)
                ceiling = noise_alone(sensor, pairs[channel], low, high)
                least = LEAST.get(sensor.quantity, LEAST_AXIS.get(str(sensor.at.get('axis'))))
                subject = f'another program: {path.name}'
                label = f'{group}, {low:g} to {high:g} Hz'
                bar = least if low == 0.0 else None
                found += [
                    Figure(subject, f'{label}: correlation', r, least=bar),
                    Figure(subject, f'{label}: the same, if only the sensor made noise', ceiling),
                    Figure(subject, f'{label}: amplitude measured over simulated', ratio),
                ]
    return found


def _groups(machine: Machine) -> dict[str, list[str]]:
    """Return channels by quantity and direction."""
    groups: dict[str, list[str]] = {}
    for sensor in machine.instruments.sensors:
        name = ' '.join(filter(None, (sensor.quantity, str(sensor.at.get('axis', '')))))
        groups.setdefault(name.replace('_', ' '), []).append(sensor.channel)
    return groups
