"""Compare a long recording part by part, in memory that does not grow with it."""

from collections.abc import Iterable, Mapping, Sequence
import os
from typing import Any

import numpy as np

from escalator_twin.bagfile import read
from escalator_twin.bagfile.source import topics
from escalator_twin.check.document import windows_of
from escalator_twin.comparison.document import recording_document
from escalator_twin.comparison.judge import bands_of, judge, Judgement
from escalator_twin.comparison.locate import locate, RATE_HZ, Setting, simulate_loop
from escalator_twin.errors import EscalatorError, RecordingError, SynchronisationError
from escalator_twin.machine import Machine
from escalator_twin.metrics import Bands
from escalator_twin.signals import Recording
from escalator_twin.sync.template import Template
from escalator_twin.twin import make_simulation, run_twin

LONG_S = 900.0  # a longer recording is compared in parts
PART_S = 450.0  # with what earlier parts leave in the heap, no more than ten minutes at once
# One loop of the twin serves a part whose speed is this close to the loop's: it only finds the
# place, and the run beside the part is at the part's own speed.
SAME_SPEED = 0.005
# correlation -> the pair of signals whose sums of deviations are pooled
CORRELATIONS = {
    'r_time': 'low_kept',
    'ripple_r': 'ripple_kept',
    'ceiling_r_time': 'low_twice',
    'ripple_ceiling': 'ripple_twice',
}
DEVIATIONS = {'nrmse': 'low_kept', 'ripple_nrmse': 'ripple_kept'}
AVERAGED = ('r_freq', 'lag_s', 'ceiling_share', 'orders', 'sides', 'sensor_pose')
Sums = dict[str, np.ndarray]  # pair -> sums of squares: measured, simulated, their product


def part_bounds(path: str | os.PathLike[str], machine: Machine) -> list[tuple[int, int]]:
    """Return the windows of bag time in which a bag is compared; none where it is short."""
    return windows_of(topics(path), machine, LONG_S, PART_S)


def compare_in_parts(
    path: str | os.PathLike[str], machine: Machine, bounds: Sequence[tuple[int, int]]
) -> dict[str, Any]:
    """Return a long recording's part of the JSON of ``compare``.

    Every part is read, placed, simulated and scored by itself. Correlations and ``nrmse`` are
    pooled: sums of products of deviations, each from its part's mean, are added over the parts.
    The other scores have no pooled form and are means over the parts, weighed by samples; a
    phase's is that of the mean direction. Speed is the mean by duration. Place, clock, and the
    overlay are the first part's. The key ``parts`` says so.

    Parameters
    ----------
    path : path
    machine : Machine
    bounds : sequence of (int, int)
        As `part_bounds` gives them.

    Raises
    ------
    EscalatorError
        Where no part can be compared: the first part's error.
    """
    documents: list[dict[str, Any]] = []
    sums: list[dict[str, Sums]] = []
    spans: list[tuple[float, float]] = []
    failed: list[tuple[float, EscalatorError]] = []
    template: Template | None = None
    speed = 0.0
    for from_ns, to_ns in bounds:
        from_s, to_s = ((t - bounds[0][0]) / 1e9 for t in (from_ns, to_ns))
        recording = read(path, machine, from_ns=from_ns, to_ns=to_ns)
        try:
            setting, judgement = _compare(recording, machine, template, speed)
        except (RecordingError, SynchronisationError) as error:
            failed.append((from_s, error))
            continue
        document = recording_document(recording, setting, judgement, machine)
        if documents:
            del document['overlay']
        documents.append(document)
        spans.append((from_s, to_s))
        sums.append({c: _sums(bands_of(a, machine)) for c, a in judgement.channels.items()})
        if template is None:
            speed = setting.experiment.set_speed_m_s
            template = simulate_loop(machine, setting.experiment)
        del recording, setting, judgement
    if not documents:
        raise failed[0][1]
    return merge_parts(documents, sums, spans, [(at, str(error)) for at, error in failed])


def _compare(
    recording: Recording, machine: Machine, template: Template | None, speed_m_s: float
) -> tuple[Setting, Judgement]:
    """Place one part and score it; a loop at another speed does not serve."""
    setting = locate(recording, machine, template)
    real = setting.experiment.set_speed_m_s
    if template is not None and abs(real / speed_m_s - 1.0) > SAME_SPEED:
        setting = locate(recording, machine)
    trace = run_twin(
        make_simulation(machine, setting.experiment),
        machine.instruments.sensors,
        setting.start_s_m,
        setting.duration_s,
        RATE_HZ,
    )
    return setting, judge(setting, trace, machine)


def _sums(bands: Bands) -> Sums:
    """Return the sums of products of deviations of every pair that is pooled; n comes last."""
    found = {}
    for name in dict.fromkeys(CORRELATIONS.values()):
        m, s = getattr(bands, name)
        m, s = (row - row.mean() if len(row) else row for row in (m, s))
        found[name] = np.array([m @ m, s @ s, m @ s, len(m)])
    return found


# joining the parts


def merge_parts(
    documents: Sequence[Mapping[str, Any]],
    sums: Sequence[Mapping[str, Sums]],
    spans: Sequence[tuple[float, float]],
    failed: Sequence[tuple[float, str]] = (),
) -> dict[str, Any]:
    """Join the parts' documents to the recording's; see `compare_in_parts`."""
    durations = np.array([to_s - from_s for from_s, to_s in spans])
    merged = dict(documents[0])
    merged['speed_m_s'] = _speed([d['speed_m_s'] for d in documents], durations)
    merged['place_is_certain'] = all(d['place_is_certain'] for d in documents)
    names = dict.fromkeys(c for d in documents for c in d['channels'])
    merged['channels'] = {c: _channel(c, documents, sums) for c in names}
    for key in ('sides', 'sensor_pose'):
        merged[key] = _mean([d[key] for d in documents], durations)
    merged['quality'] = _quality(documents, spans)
    merged['parts'] = {
        'n': len(documents),
        'pooled': [*CORRELATIONS, *DEVIATIONS],
        'averaged': list(AVERAGED),
        'each': [
            {'from_s': span[0], 'to_s': span[1], 'speed_m_s': d['speed_m_s'], 'start_s_m': d['start_s_m']}
            for span, d in zip(spans, documents, strict=True)
        ],
        'failed': [{'from_s': at, 'reason': reason} for at, reason in failed],
    }  # fmt: skip
    return merged


def _speed(speeds: Sequence[Mapping[str, float]], durations: np.ndarray) -> dict[str, float]:
    """Return the mean speed by duration; the parts' errors are independent."""
    weight = durations / durations.sum()
    value = float(weight @ [s['value'] for s in speeds])
    low, high = (
        float(np.sqrt(((weight * [s[end] - s['value'] for s in speeds]) ** 2).sum()))
        for end in ('low', 'high')
    )
    return {'value': value, 'low': value - low, 'high': value + high}


def _channel(
    name: str, documents: Sequence[Mapping[str, Any]], sums: Sequence[Mapping[str, Sums]]
) -> dict[str, Any]:
    """Return the scores of one channel over all parts that have it."""
    there = [
        (d['channels'][name], s[name])
        for d, s in zip(documents, sums, strict=True)
        if name in d['channels']
    ]
    scores = [score for score, _ in there]
    n = np.array([part['low_kept'][3] for _, part in there])
    merged: dict[str, Any] = {}
    for key in scores[0]:
        if key in CORRELATIONS or key in DEVIATIONS:
            pair = {**CORRELATIONS, **DEVIATIONS}[key]
            known = [part[pair] for score, part in there if score[key] is not None]
            merged[key] = _pooled(key, known)
        else:
            merged[key] = _mean([score[key] for score in scores], n)
    return merged


def _pooled(key: str, sums: Sequence[np.ndarray]) -> float | None:
    """Return a correlation or a normalised difference from sums of products of deviations."""
    if not sums:
        return None
    mm, ss, ms, _ = np.sum(sums, axis=0)
    if not mm > 0.0 or (key in CORRELATIONS and not ss > 0.0):
        return None
    if key in CORRELATIONS:
        return float(np.clip(ms / np.sqrt(mm * ss), -1.0, 1.0))
    return float(np.sqrt(max(mm + ss - 2.0 * ms, 0.0) / mm))


def _mean(values: Sequence[Any], weights: Iterable[float]) -> Any:
    """Return the weighted mean of numbers, place by place through lists and mappings.

    ``None`` where no part has a number; what is no number is the first part's.
    """
    known = [(v, w) for v, w in zip(values, weights, strict=True) if v is not None and w > 0.0]
    if not known:
        return values[0]
    rows, weight = [v for v, _ in known], [w for _, w in known]
    first = rows[0]
    if isinstance(first, Mapping):
        return {
            key: _phase([row.get(key) for row in rows], weight)
            if key == 'phase_deg'
            else _mean([row.get(key) for row in rows], weight)
            for key in dict.fromkeys(key for row in rows for key in row)
        }
    if isinstance(first, list | tuple):
        same = [(row, w) for row, w in known if len(row) == len(first)]
        weight = [w for _, w in same]
        return [_mean(cells, weight) for cells in zip(*(row for row, _ in same), strict=True)]
    if isinstance(first, bool) or not isinstance(first, int | float):
        return first
    return float(np.average(rows, weights=weight))


def _phase(values: Sequence[float | None], weights: Sequence[float]) -> float | None:
    """Return the direction of the mean of directions, degrees."""
    known = [(v, w) for v, w in zip(values, weights, strict=True) if v is not None]
    if not known:
        return None
    total = sum(w * np.exp(1j * np.deg2rad(v)) for v, w in known)
    return float(np.rad2deg(np.angle(total)))


def _quality(
    documents: Sequence[Mapping[str, Any]], spans: Sequence[tuple[float, float]]
) -> list[dict[str, Any]]:
    """Return all parts' findings in the recording's time; what holds for all is told once."""
    found: list[dict[str, Any]] = []
    told = set()
    for document, (from_s, _) in zip(documents, spans, strict=True):
        for row in document['quality']:
            is_timed = row['to_s'] > row['from_s']
            key = (row['kind'], row['channel'], row['detail'])
            if not is_timed and key in told:
                continue
            told.add(key)
            shift = from_s if is_timed else 0.0
            found.append({**row, 'from_s': row['from_s'] + shift, 'to_s': row['to_s'] + shift})
    return found
