"""What several recordings of one machine say, told together."""

from collections.abc import Sequence
from dataclasses import replace
from math import exp
from typing import Any

import numpy as np

from escalator_twin.diagnosis.campaign import Joint
from escalator_twin.diagnosis.conclusion import NAMED
from escalator_twin.diagnosis.confirm import Confirmed
from escalator_twin.diagnosis.faults import Fault
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.speeds import Law, LEAST_RISE
from escalator_twin.diagnosis.telling import told, told_fault
from escalator_twin.diagnosis.verdict import ALIKE

DRAWS = 2000


def by_speed(joint: Sequence[Joint], law: Law | None, seed: int) -> list[Joint]:
    """Return the effects with rolling resistance put down to one factor or to a law of speed.

    The law is named where it is likelier than a constant, more than a good machine's, and foretells each
    recording from the others better than their constant does.

    Parameters
    ----------
    joint : sequence of Joint
    law : Law or None
        Of all recordings; None where one speed was run.
    seed : int
        Of the bootstrap over recordings.
    """
    if law is None:
        return list(joint)
    likely = 1.0 / (1.0 + exp(-law.evidence))
    picks = np.random.default_rng(seed).integers(0, len(law.gain), (DRAWS, len(law.gain)))
    gains = float(np.quantile(law.gain[picks].mean(axis=1), 0.025)) > 0.0
    if likely < NAMED or law.rise < LEAST_RISE or not gains:
        ruled_out = ('friction_speed',) if law.evidence < -ALIKE else ()
        return [
            replace(j, ruled_out=ruled_out)
            if j.found.proposal.cause == 'rolling_resistance'
            else j
            for j in joint
        ]
    kept = [j for j in joint if j.found.proposal.cause != 'rolling_resistance']
    numbers = {'rise': law.rise, 'speed_m_s': law.speed_m_s}
    proposal = Proposal('friction_speed', {}, numbers, 0.0, fitted=tuple(numbers))
    found = Found(proposal, likely, dict(law.sd), float(law.gain.sum()), ())
    named = Joint(found, min(likely, 0.99), int(np.sum(law.gain > 0.0)))
    return sorted([*kept, named], key=lambda j: -j.probability)


def told_jointly(
    joint: Sequence[Joint], faults: Sequence[Sequence[Fault]], total: int
) -> list[dict[str, Any]]:
    """Return effects as contracts.md tells them, with how many of the recordings show each.

    Parameters
    ----------
    joint : sequence of Joint
    faults : sequence of sequences of Fault
        Of each recording.
    total : int
        Recordings.
    """
    effects = []
    for j in joint:
        one = told(j.found, j.probability)
        one['alternatives'] = [name for name in one['alternatives'] if name not in j.ruled_out]
        effects.append({**one, 'recordings': j.recordings, 'of': total})
    groups: dict[tuple[str, str], list[Fault]] = {}
    for fault in (f for row in faults for f in row):
        groups.setdefault((fault.cause, str(fault.location)), []).append(fault)
    for group in groups.values():
        effects.append({**told_fault(_middle(group)), 'recordings': len(group), 'of': total})
    return sorted(effects, key=lambda e: -e['probability'])


def _middle(group: Sequence[Fault]) -> Fault:
    """Return a fault with the means of its numbers, as wide as all of them."""
    parameters = {}
    for name in group[0].parameters:
        rows = np.array([f.parameters[name] for f in group if name in f.parameters])
        parameters[name] = (
            float(rows[:, 0].mean()),
            float(rows[:, 1].min()),
            float(rows[:, 2].max()),
        )
    return replace(group[0], parameters=parameters)


def joint_gain(confirmed: Sequence[Confirmed], seed: int) -> dict[str, Any]:
    """Return the gain in the recordings that no size was fitted to."""
    seen = [c.held_out for c in confirmed if c.held_out.channels is not None]
    if not seen:
        return {'held_out': None, 'split': 'no recording is left that no size was fitted to'}
    names = sorted({name for held in seen for name in held.channels or {}})
    channels = {}
    for name in names:
        rows = [h.channels[name] for h in seen if h.channels and name in h.channels]
        channels[name] = {key: float(np.mean([r[key] for r in rows])) for key in rows[0]}
    gains = np.array([0.5 * (h.gain_low + h.gain_high) for h in seen])
    picks = np.random.default_rng(seed).integers(0, len(gains), (DRAWS, len(gains)))
    low, high = (float(v) for v in np.quantile(gains[picks].mean(axis=1), (0.025, 0.975)))
    split = f'{len(seen)} recordings at other operating points, beside the sizes that others gave'
    document = {
        'split': split,
        'blocks': len(seen),
        'channels': channels,
        'gain_interval': [low, high],
        'significant': low > 0.0,
        'worse': sorted({name for h in seen for name in h.worse}),
    }
    return {'held_out': document, 'split': split}
