"""Ripple and hunting of the drive: one run, then locked to travel or to time."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.regression import Fitted, inner_products, inverse
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.signals import Floats

ROUNDS = 3
QUARTER = 0.5 * np.pi


def refine_drive(
    stage: Stage,
    base: Floats,
    fitted: Fitted,
    hunting: Proposal,
    ripple: Proposal,
    jobs: int = 1,
) -> tuple[Refined, Refined]:
    """Fit amplitude, phase and frequency of a wave of the drive's speed, once for each lock.

    The twin runs at constant mean speed; what hunts keeps the recording's time, see `run_beside`.

    Parameters
    ----------
    stage : Stage
    base : (n, c) float64
    fitted : Fitted
        What that leaves, with the nuisance.
    hunting, ripple : Proposal
        Of the same frequency.
    jobs : int
        Simulations at a time.
    """
    return (
        refine_wave(stage, base, fitted, hunting, in_time=True, jobs=jobs),
        refine_wave(stage, base, fitted, ripple, in_time=False, jobs=jobs),
    )


def refine_wave(
    stage: Stage,
    base: Floats,
    fitted: Fitted,
    proposal: Proposal,
    in_time: bool,
    jobs: int = 1,
) -> Refined:
    """Fit a wave of the drive's speed, locked to time or to travel; see ``refine_drive``."""
    observation = stage.observation
    frame = observation.frame
    seconds = observation.travel_m / frame.speed_m_s
    key = 'frequency_hz' if in_time else 'cycles_per_pitch'
    per_hz = 1.0 if in_time else frame.pitch_m / frame.speed_m_s
    # the rack's travel, which a ripple is a wave of, falls where the machine runs down
    sense = 1.0 if in_time else float(stage.setting.experiment.direction)
    best: Refined | None = None
    before = stage.judged(fitted, proposal.cause)
    for _ in range(ROUNDS):
        size = proposal.parameters['relative_amplitude']
        one, two = _quarters(stage, base, proposal, jobs)
        clock = seconds - seconds.mean()
        fast = sense * 2.0 * np.pi * clock[:, None] * two * size / per_hz
        columns = stage.columns(np.stack([one, two, fast], axis=2), proposal.cause)
        right, gram = inner_products(stage.fit(base), columns)
        c, d, df = inverse(gram) @ right
        model = base + c * one + d * two + df * fast
        after = stage.fit(model)
        amplitude = float(np.hypot(c, d))
        # the frequency turns about the middle of the recording
        phase = proposal.parameters['phase_rad'] + float(np.arctan2(d, c))
        phase -= sense * 2.0 * np.pi * df / per_hz * float(seconds.mean())
        covariance = inverse(gram)
        moved = replace(
            proposal,
            parameters={
                'relative_amplitude': float(np.clip(amplitude, 1e-6, 0.4)),
                'phase_rad': _wrapped(phase),
                key: max(proposal.parameters[key] + float(df), 0.01),
            },
        )
        sd = {
            'relative_amplitude': float(np.sqrt(covariance[0, 0])),
            key: float(np.sqrt(covariance[2, 2])),
        }
        found = Refined(
            moved, model, after, before - stage.judged(after, proposal.cause), sd, columns,
            ('relative_amplitude', 'phase_rad', key),
        )  # fmt: skip
        if best is not None and found.gain < best.gain + 1.0:
            break
        best, proposal = found, moved
    assert best is not None
    return best


def _quarters(stage: Stage, base: Floats, proposal: Proposal, jobs: int) -> tuple[Floats, Floats]:
    """Return what a wave does to the model by one of its amplitude, and the same a quarter later."""
    phase = _wrapped(proposal.parameters['phase_rad'] + QUARTER)
    quarter = replace(proposal, parameters={**proposal.parameters, 'phase_rad': phase})
    size = proposal.parameters['relative_amplitude']
    with ThreadPoolExecutor(max(1, min(jobs, 2))) as pool:
        runs = pool.map(lambda p: stage.run((p.deviation,)), (proposal, quarter))
        one, two = ((run - base) / size for run in runs)
    return one, two


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


@dataclass(frozen=True)
class Told:
    """How a wave locked to time compares with one locked to travel.

    Attributes
    ----------
    better : float
        By how much more the first explains, of chi squared; negative where the other does.
    apart : float
        The same, where the better one is true and nothing else is off.
    """

    better: float
    apart: float


def locks(stage: Stage, base: Floats, hunting: Proposal, jobs: int = 1) -> Told:
    """Compare a wave locked to time with one locked to travel.

    Both are taken from the same two runs: what two runs differ by through rattling
    rollers is more than what the locks differ by.
    """
    observation = stage.observation
    seconds = observation.travel_m / observation.frame.speed_m_s
    late = observation.time_s - seconds[:, None]
    late = late - late.mean(axis=0)
    one, two = _quarters(stage, base, hunting, jobs)
    turn = 2.0 * np.pi * hunting.parameters['frequency_hz'] * late
    rows = (
        (one, two),
        (one * np.cos(turn) - two * np.sin(turn), two * np.cos(turn) + one * np.sin(turn)),
    )
    clock = (seconds - seconds.mean())[:, None]
    waves = [wave for a, b in rows for wave in (a, b, clock * a, clock * b)]
    columns = stage.columns(np.stack(waves, axis=2), hunting.cause)
    return told_apart(*inner_products(stage.fit(base), columns))


def agreed(one: Told, other: Told) -> float:
    """Return by how much more a lock explains, of what two alignments of a recording say.

    Aligned beside a wave of one lock, a recording is bent a little towards that lock: by 11 of chi squared more, where
    what tells the locks apart is 13 and beside the other lock it was 2 less (seed 251101, number 0). The mean of both
    is taken, and half of what they differ by is noise beside the 2 root D of `told_apart`: the odds of two normal numbers
    whose means are D and -D.
    """
    better, off = 0.5 * (one.better + other.better), 0.5 * (one.better - other.better)
    own = 2.0 * (one.apart + other.apart)
    return better * own / (own + off * off) if own > 0.0 else 0.0


def told_apart(right: Floats, gram: Floats) -> Told:
    """Return by how much more one model explains than another, as far as the two differ at all.

    Were the better one true, it would explain as much more as what it says is off the other's reach, D, give
    or take noise: 2 root D. What is beyond both speaks of an error of either.

    Parameters
    ----------
    right : (2 k,) float64
        Of the columns of the one model, then of the other, see `inner_products`.
    gram : (2 k, 2 k) float64

    Returns
    -------
    told : Told
        Of the one against the other.
    """
    half = len(right) // 2
    one, other = slice(0, half), slice(half, None)
    gains = [float(right[m] @ inverse(gram[m, m]) @ right[m]) for m in (one, other)]
    if gains[0] < gains[1]:
        one, other = other, one
    sizes = inverse(gram[one, one]) @ right[one]
    across = gram[one, other]
    unlike = gram[one, one] - across @ inverse(gram[other, other]) @ across.T
    apart = max(float(sizes @ unlike @ sizes), 0.0)
    most = apart + 2.0 * apart**0.5
    return Told(float(np.clip(gains[0] - gains[1], -most, most)), apart)
