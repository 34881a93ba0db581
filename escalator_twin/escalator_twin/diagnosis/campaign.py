"""Several recordings of one machine: what they say together.

A few recordings, as different as the plan of experiments has them, are searched in full: the
scouts; what all of the first ones name is suggested to the others, which fit it and look for more. What
they name is put beside every other recording as it is, which proves it on data that no fit has
seen, and refines its size; and beside every scout that does not name it, which may contradict.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, log

import numpy as np

from escalator_twin.diagnosis.conclusion import NAMED
from escalator_twin.diagnosis.confirm import Confirmed
from escalator_twin.diagnosis.diagnose import Diagnosis
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import is_other_side, Proposal, same_place
from escalator_twin.diagnosis.verdict import LAW_ERROR, neutral_of
from escalator_twin.signals import Floats

# One scout in four may name what it alone shows: with three scouts or more, and nobody left to
# confirm it, a cause needs two of them.
MANY = 3
SURE_SD = 3.0  # standard deviations from neutral at which other recordings confirm an effect
LEAST_PART = 0.4  # of the scouts' size that the others must find
BLIND = 0.5  # of the size: a standard deviation beyond which the others say nothing
CONFIRMED = 0.98
# Of a side that a scout did not weigh: as sure as any verdict is told to be.
UNSEEN = 0.01
# Where the carriage rests is a matter of the machine's own lengths, in all of its recordings alike.
COMMON = ('displacement_m',)

Sized = tuple[
    Proposal, Mapping[str, float]
]  # an effect as one recording has it, standard deviations


Named = tuple[Found, float, int]  # an effect, its probability, by which scout


@dataclass(frozen=True)
class Joint:
    """One effect in several recordings.

    Attributes
    ----------
    found : Found
        With the numbers of all recordings.
    probability : float
    recordings : int
        How many of them show it.
    ruled_out : tuple of str
        Causes that one recording cannot tell from it and several can.
    """

    found: Found
    probability: float
    recordings: int
    ruled_out: tuple[str, ...] = ()


def union_of(scouts: Sequence[Diagnosis]) -> list[list[tuple[Found, float]]]:
    """Return what the scouts name, each effect with all who name it, the surest first.

    Of one thing that scouts name on different sides it is the side that all of these believe in most.
    """
    groups: list[list[Named]] = []
    for k, scout in enumerate(scouts):
        for found, probability in scout.found:
            if probability < NAMED:
                continue
            row = (found, probability, k)
            home = next((g for g in groups if same_place(g[0][0].proposal, found.proposal)), None)
            if home is None:
                groups.append([row])
            else:
                home.append(row)
    for group in groups:
        group.sort(key=lambda row: -row[1])
    groups.sort(key=lambda g: (-len(g), -g[0][1]))
    return [[(found, p) for found, p, _ in group] for group in _one_side_each(groups)]


def _one_side_each(groups: list[list[Named]]) -> list[list[Named]]:
    """Return groups without those that are another one's other side, by the product of what scouts believe.

    One names a rail's step on the right and another one at the same place on both sides, since x and z of a step
    hardly tell. Where one scout names both they are two effects.
    """
    kept: list[list[Named]] = []
    while groups:
        rivals = [g for g in groups if g is groups[0] or _is_rival(g, groups[0])]
        groups = [g for g in groups if not any(g is r for r in rivals)]
        rows = [found for group in rivals for found, _, _ in group]
        kept.append(max(rivals, key=lambda g: sum(_belief(f, g[0][0].proposal) for f in rows)))
    return kept


def _is_rival(group: Sequence[Named], other: Sequence[Named]) -> bool:
    by_one = {k for _, _, k in group} & {k for _, _, k in other}
    return not by_one and is_other_side(group[0][0].proposal, other[0][0].proposal)


def _belief(found: Found, other: Proposal) -> float:
    """Return the logarithm of the probability that what a scout found is on another one's side."""
    own = found.probability if same_place(found.proposal, other) else 0.0
    seen = (r.probability for r in found.rivals if same_place(r.proposal, other))
    return log(max(own, max(seen, default=0.0), UNSEEN))


def pooled(rows: Sequence[Sized]) -> Found:
    """Return one effect from what several recordings make of its numbers.

    Parameters
    ----------
    rows : sequence of (proposal, standard deviations)
        Of one effect; the first gives place and whatever has no standard deviation.
    """
    first = rows[0][0]
    parameters, location = dict(first.parameters), dict(first.location)
    sd: dict[str, float] = {}
    for key in (*first.fitted, *(k for k in first.parameters if k not in first.fitted)):
        if key == 'phase_rad':
            continue  # each recording has its own
        known = [(_value(p, key), s[key]) for p, s in rows if s.get(key, 0.0) > 0.0]
        known = [row for row in known if row[0] is not None]
        if not known:
            continue
        mean, spread = _mean(np.array([[v, s] for v, s in known], float))
        sd[key] = max(spread, min(s for _, s in known)) if key in COMMON else spread
        if key.startswith('@'):
            location[key[1:]] = mean
        else:
            parameters[key] = mean
    proposal = replace(first, parameters=parameters, location=location)
    return Found(proposal, 0.0, sd, 0.0, ())


def _value(proposal: Proposal, key: str) -> float | None:
    value = proposal.location.get(key[1:]) if key[0] == '@' else proposal.parameters.get(key)
    return float(value) if isinstance(value, float | int) else None


def _mean(rows: Floats) -> tuple[float, float]:
    """Return a weighted mean and its standard deviation, by what they say and by their scatter."""
    values, sds = rows.T
    sds = np.hypot(sds, LAW_ERROR * np.abs(values).max())
    weights = sds**-2.0
    mean = float(np.sum(weights * values) / weights.sum())
    own = float(weights.sum() ** -0.5)
    if len(values) == 1:
        return mean, own
    scatter = float(np.sqrt(np.sum(weights * (values - mean) ** 2) / weights.sum()))
    return mean, max(own, scatter / (len(values) - 1) ** 0.5)


def decide(
    groups: Sequence[Sequence[tuple[Found, float]]],
    n_scouts: int,
    confirmed: Sequence[Confirmed],
    silent: Sequence[Sequence[Sized]] = (),
    together: Mapping[int, Sized] | None = None,
) -> list[Joint]:
    """Accept what some scouts name where it holds in the other recordings as well.

    Parameters
    ----------
    groups : sequence of groups
        As `union_of` gives them.
    n_scouts : int
    confirmed : sequence of Confirmed
        The other recordings, their effects in the groups' order.
    silent : sequence of sequences of (proposal, standard deviations), optional
        Of each group, what it comes to in the scouts that do not name it.
    together : mapping of int to (proposal, spread), optional
        By group, what was fitted to all scouts at once: in the place of a mean. It is told to be no surer.
    """
    accepted = []
    for k, group in enumerate(groups):
        scouts = [(f.proposal, f.sd) for f, _ in group]
        others = [(c.effects[k], c.sd[k]) for c in confirmed] + list(silent[k] if silent else ())
        missing = float(np.prod([1.0 - min(p, 0.99) for _, p in group]))
        probability = 1.0 - missing
        verdict = _held(pooled(scouts).proposal, others) if others else None
        if verdict is False or (verdict is None and n_scouts >= MANY and len(group) < 2):
            continue
        if verdict:
            probability = max(probability, CONFIRMED)
        best = group[0][0]
        found = pooled(scouts + others)
        if together and k in together:
            found = resized(found, *together[k])
        found = replace(found, probability=probability, gain=best.gain, rivals=best.rivals)
        shows = len(group) + sum(_shows(p, sd) for p, sd in others)
        accepted.append(Joint(found, min(probability, 0.99), shows))
    return sorted(accepted, key=lambda j: -j.probability)


def resized(found: Found, effect: Proposal, spread: Mapping[str, float]) -> Found:
    """Return a pooled effect with the numbers of one fit to several recordings, and the wider spread of both."""
    own = {key: by for key, by in spread.items() if isfinite(by)}
    sd = {key: max(found.sd.get(key, 0.0), own.get(key, 0.0)) for key in effect.fitted}
    return replace(found, proposal=effect, sd=sd)


def _held(scouts: Proposal, others: Sequence[Sized]) -> bool | None:
    """Tell whether other recordings find an effect as well; None where they cannot tell."""
    key = _largest(scouts)
    sized = [(p, sd) for p, sd in others if sd.get(key, 0.0) > 0.0]
    if not sized:
        return None
    found = pooled(sized)
    neutral = neutral_of(scouts.cause, key)
    theirs = found.proposal.parameters[key] - neutral
    ours = scouts.parameters[key] - neutral
    if found.sd[key] > BLIND * abs(ours):
        return None
    return theirs / ours > LEAST_PART and abs(theirs) > SURE_SD * found.sd[key]


def _largest(proposal: Proposal) -> str:
    """Return the number that sizes an effect: of a turned sensor's angles the largest; empty without one."""
    angles = [key for key in proposal.fitted if key.endswith('_deg')]
    if angles:
        return max(angles, key=lambda key: abs(proposal.parameters[key]))
    return proposal.fitted[0] if proposal.fitted else ''


def _shows(proposal: Proposal, sd: Mapping[str, float]) -> bool:
    key = _largest(proposal)
    way = proposal.parameters.get(key, 0.0) - neutral_of(proposal.cause, key)
    return sd.get(key, 0.0) > 0.0 and abs(way) > SURE_SD * sd[key]
