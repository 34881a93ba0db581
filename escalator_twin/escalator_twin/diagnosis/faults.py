"""Faults of the measurement that show without a model, or in placing the recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import re

from escalator_twin.check.gaps import is_scattered
from escalator_twin.comparison.exchanged import exchanged, other_of
from escalator_twin.comparison.locate import Setting
from escalator_twin.machine import Machine
from escalator_twin.signals import Finding

# Of 100 such findings on generated recordings none was wrong; what that leaves open at 95 %.
SURE = 0.97
CLOCK_TOLERANCE_PPM = 20.0  # contracts.md
CLOCK_TOLERANCES = 3.0
SAME_GAP_S = 0.1


@dataclass(frozen=True)
class Fault:
    """A fault of the measurement.

    Attributes
    ----------
    parameters : mapping of name to (value, low, high)
    """

    cause: str
    location: dict[str, object]
    parameters: Mapping[str, tuple[float, float, float]]
    probability: float = SURE


def faults_of(setting: Setting, machine: Machine) -> list[Fault]:
    """Return the faults that placing a recording has found.

    Parameters
    ----------
    setting : Setting
    machine : Machine
    """
    findings = list(setting.findings)
    plugged = exchanged(findings)
    return [
        *_dead(findings, machine, plugged),
        *_inverted(findings, machine),
        *_swapped(findings),
        *_hum(findings, machine, plugged),
        *_gaps(findings),
        *_spikes(findings),
        *_clock(setting, machine),
    ]


def _of(findings: Sequence[Finding], kind: str) -> list[Finding]:
    return [f for f in findings if f.kind == kind]


def _number(pattern: str, text: str) -> float | None:
    found = re.search(pattern, text)
    return float(found.group(1)) if found else None


def _dead(
    findings: Sequence[Finding], machine: Machine, plugged: Mapping[str, str]
) -> list[Fault]:
    faults = {}
    for finding in _of(findings, 'gauge_dead'):
        part = _number(r'part (\d+) of', finding.detail)
        if part is not None:
            channel = plugged.get(finding.channel, finding.channel)
            name = machine.instruments.sensor(channel).name
            place: dict[str, object] = {'link': name, 'gauge': int(part)}
            faults[name, int(part)] = Fault('gauge_dead', place, {})
    return list(faults.values())


def _inverted(findings: Sequence[Finding], machine: Machine) -> list[Fault]:
    """Tell which axes are inverted; of a link that is, the finding tells: it is no cause of the list."""
    places = [machine.instruments.sensor(f.channel).at for f in _of(findings, 'axis_inverted')]
    return [Fault('axis_inverted', {'axis': at['axis']}, {}) for at in places if 'axis' in at]


def _swapped(findings: Sequence[Finding]) -> list[Fault]:
    faults = []
    for finding in _of(findings, 'channel_swap'):
        other = other_of(finding)
        if other is not None:
            channels = [finding.channel, other]
            faults.append(Fault('channel_swap', {'channels': channels}, {}))
    return faults


def _hum(findings: Sequence[Finding], machine: Machine, plugged: Mapping[str, str]) -> list[Fault]:
    """Gather the links that hum at one frequency."""
    groups: dict[float, list[tuple[str, float]]] = {}
    for finding in _of(findings, 'mains_hum'):
        sensor = machine.instruments.sensor(plugged.get(finding.channel, finding.channel))
        amplitude = _number(r'tone of (\S+)', finding.detail)
        mains = _number(r'mains of (\S+) Hz', finding.detail)
        if sensor.quantity == 'link_force' and amplitude is not None and mains is not None:
            groups.setdefault(mains, []).append((sensor.name, amplitude))
    faults = []
    for mains, members in groups.items():
        sizes = [size for _, size in members]
        middle = sum(sizes) / len(sizes)
        half = max(max(sizes) - min(sizes), 0.03 * middle)
        faults.append(
            Fault(
                'mains_hum',
                {'links': [name for name, _ in members]},
                {
                    'strain': (middle, middle - half, middle + half),
                    'frequency_hz': (mains, mains - 0.1, mains + 0.1),
                },
            )
        )
    return faults


def _gaps(findings: Sequence[Finding]) -> list[Fault]:
    """Gather the channels that miss samples at one time, each gap by itself."""
    groups: list[tuple[float, float, list[str]]] = []
    for finding in _of(findings, 'data_gap'):
        if not finding.channel or is_scattered(finding):
            continue
        for start, end, channels in groups:
            if abs(start - finding.from_s) < SAME_GAP_S and abs(end - finding.to_s) < SAME_GAP_S:
                channels.append(finding.channel)
                break
        else:
            groups.append((finding.from_s, finding.to_s, [finding.channel]))
    return [
        Fault(
            'data_gap',
            {'channels': channels},
            {
                'from_s': (start, start - 0.02, start + 0.02),
                'to_s': (end, end - 0.02, end + 0.02),
            },
        )
        for start, end, channels in groups
        if end - start > SAME_GAP_S
    ]


def _spikes(findings: Sequence[Finding]) -> list[Fault]:
    faults = []
    for finding in _of(findings, 'sensor_spikes'):
        count = _number(r'(\d+) isolated', finding.detail)
        if count is not None:
            spread = max(1.0, 0.1 * count)
            faults.append(
                Fault(
                    'sensor_spikes',
                    {'channel': finding.channel},
                    {'count': (count, count - spread, count + spread)},
                )
            )
    return faults


def _clock(setting: Setting, machine: Machine) -> list[Fault]:
    """Tell a clock whose drift is far beyond a good one's."""
    faults = []
    for name, clock in setting.comparisons.items():
        limit = machine.instruments.loggers[name].drift_ppm
        if clock.drift_ppm is None or clock.drift_high_ppm is None:
            continue
        doubt = clock.drift_high_ppm - clock.drift_ppm
        worst = max(limit, CLOCK_TOLERANCES * CLOCK_TOLERANCE_PPM) + 2.0 * doubt
        if abs(clock.drift_ppm) > worst:
            half = max(doubt, 1.0)
            value = clock.drift_ppm
            faults.append(Fault('clock_drift', {}, {'ppm': (value, value - half, value + half)}))
    return faults
