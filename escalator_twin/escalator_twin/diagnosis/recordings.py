"""What several recordings say each by itself, and its part in what is told of all."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from escalator_twin.diagnosis.confirm import Confirmed
from escalator_twin.diagnosis.diagnose import Diagnosis
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.telling import told
from escalator_twin.diagnosis.unexplained import Unexplained

MOST_CANDIDATES = 40


def searched_row(scout: Diagnosis) -> dict[str, Any]:
    """Return what a recording that was searched says."""
    return {
        'path': scout.document['path'],
        'document': scout.document,
        'effects': scout.effects,
        'candidates': scout.candidates,
        'unexplained': rest_of(scout.unexplained),
        'gain': scout.held_out.document() if scout.held_out else None,
        'residual': scout.residual,
        'rolled': asdict(scout.rolled) if scout.rolled else None,
        'searched': True,
    }


def confirmed_row(one: Confirmed) -> dict[str, Any]:
    """Return what a recording that was put beside others' effects says."""
    return {
        'path': one.document['path'],
        'document': one.document,
        'effects': [_own(effect, sd) for effect, sd in zip(one.effects, one.sd, strict=True)],
        'candidates': [],
        'unexplained': rest_of(one.unexplained),
        'gain': one.held_out.document(),
        'residual': one.residual,
        'rolled': asdict(one.rolled) if one.rolled else None,
        'searched': False,
    }


def _own(effect: Proposal, sd: dict[str, float]) -> dict[str, Any]:
    """Return an effect with the size that one recording alone would give it."""
    return {**told(Found(effect, 0.0, sd, 0.0, ()), 0.0), 'probability': None}


def rest_of(rest: Unexplained) -> dict[str, Any]:
    """Return a remainder as contracts.md tells it."""
    return {'significant': rest.significant, 'share': rest.share, 'signature': rest.signature}


def largest_rest(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the largest remainder of all recordings."""
    worst = max(rows, key=lambda row: (row['significant'], row['share']))
    return {**worst, 'recordings': sum(bool(row['significant']) for row in rows)}


def judged(scouts: Sequence[Diagnosis]) -> list[Diagnosis]:
    """Return the searches of recordings with a certain place: the others judged nothing."""
    return [scout for scout in scouts if scout.is_placed]


def mean_candidates(scouts: Sequence[Diagnosis]) -> list[dict[str, Any]]:
    """Return the candidates of all searches, each once with its mean probability.

    A recording that was not judged speaks against none.
    """
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    count = max(1, len(judged(scouts)))
    for scout in scouts:
        for row in scout.candidates:
            rows.setdefault((row['cause'], str(row['location'])), []).append(row)
    joint = [
        {**group[0], 'probability': min(1.0, sum(r['probability'] for r in group) / count)}
        for group in rows.values()
    ]
    return sorted(joint, key=lambda row: -row['probability'])[:MOST_CANDIDATES]


def own_gain(scouts: Sequence[Diagnosis]) -> dict[str, Any]:
    """Return the held-out gain inside the recordings, where all of them were searched."""
    held = [s.held_out for s in scouts if s.held_out is not None]
    seen = [h for h in held if h.channels is not None]
    if not seen:
        return {'held_out': None, 'split': held[0].split if held else 'nothing was accepted'}
    names = {name for h in seen for name in h.channels or {}}
    channels = {}
    for name in sorted(names):
        rows = [h.channels[name] for h in seen if h.channels and name in h.channels]
        channels[name] = {key: sum(r[key] for r in rows) / len(rows) for key in rows[0]}
    split = f'{len(seen)} recordings, each: {seen[0].split}'
    document = {
        'split': split,
        'blocks': sum(h.blocks for h in seen),
        'channels': channels,
        'significant': all(h.significant for h in seen),
    }
    return {'held_out': document, 'split': split}
