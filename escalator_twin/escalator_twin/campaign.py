"""Diagnose several recordings of one machine: some searched in full, the others as their proof."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import asdict
from functools import partial
from typing import Any

from escalator_twin import bagfile
from escalator_twin.diagnosis.campaign import (
    by_speed,
    choose_scouts,
    decide,
    FIRST,
    Joint,
    joint_gain,
    shared_by,
    told_jointly,
    union_of,
)
from escalator_twin.diagnosis.confirm import confirm_recording, Confirmed
from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.diagnose import diagnose_recording, Diagnosis
from escalator_twin.diagnosis.floor import load_floor
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.leftovers import names_all, repeated_by
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.speeds import KNOB, law_of
from escalator_twin.diagnosis.telling import told
from escalator_twin.diagnosis.together import fitted_together, Groups, is_worth_it, Together
from escalator_twin.diagnosis.unexplained import Unexplained
from escalator_twin.machine import load_machine
from escalator_twin.signals import Experiment
from escalator_twin.threads import one_thread_each

MOST_CANDIDATES = 40
# Of a full search, and of the fit of all searched recordings together, in confirmations: for the progress alone.
SEARCH_COST, TOGETHER_COST = 3.0, 3.0
Progress = Callable[[float, float], None]


def diagnose_bag(
    path: str,
    machine_path: str,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
    suggested: Sequence[Proposal] = (),
) -> Diagnosis:
    """Diagnose one recording; see `diagnose_recording`."""
    machine = load_machine(machine_path)
    recording = bagfile.read(path, machine)
    return diagnose_recording(recording, machine, seed, jobs, progress, suggested)


def confirm_bag(
    path: str,
    machine_path: str,
    effects: list[Proposal],
    seed: int,
    shared: Mapping[str, float] | None = None,
) -> Confirmed:
    """Put effects beside one more recording; see `confirm_recording`."""
    machine = load_machine(machine_path)
    return confirm_recording(bagfile.read(path, machine), machine, effects, seed, shared)


@one_thread_each
def fit_bags(
    paths: Sequence[str],
    machine_path: str,
    scouts: Sequence[Diagnosis],
    groups: Groups,
    jobs: int = 1,
) -> Together | None:
    """Fit what searches name to all of their recordings; see `fitted_together`."""
    machine = load_machine(machine_path)
    floor = load_floor(machine)

    def context_of(path: str) -> Context:
        return prepare_tolerances(bagfile.read(path, machine), machine, floor)

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        contexts = list(pool.map(context_of, paths))
    return fitted_together(contexts, scouts, groups, jobs)


def experiment_of(path: str, machine_path: str) -> Experiment | None:
    """Return what was set when a recording was made."""
    return bagfile.read(path, load_machine(machine_path)).experiment


def diagnose_together(
    paths: list[str],
    machine_path: str,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[dict[str, Any], list[Joint]]:
    """Diagnose several recordings of one machine.

    Parameters
    ----------
    paths : list of str
    machine_path : str
    seed : int
        Of the bootstraps.
    jobs : int
        Recordings at once, and simulations at a time in each that is searched.
    progress : callable, optional
        Gets (done, total).

    Returns
    -------
    document : dict
        The JSON of ``diagnose`` without the extended machine.
    joint : list of Joint
        The accepted effects of machine and measurement.
    """
    n = len(paths)
    done = 0.0

    def tell(cost: float, total: float) -> None:
        nonlocal done
        done += cost
        if progress is not None:
            progress(done, total)

    with ProcessPoolExecutor(max(1, min(jobs, n))) as pool:
        experiments = list(pool.map(experiment_of, paths, [machine_path] * n))
        chosen = choose_scouts(experiments)
        others = [k for k in range(n) if k not in chosen]
        total = SEARCH_COST * len(chosen) + len(others)

        def searched(some: Sequence[int], suggested: Sequence[Proposal]) -> list[Diagnosis]:
            # each with all jobs: one may end long before the other, and two are fewer than many cores
            search = partial(
                diagnose_bag, machine_path=machine_path, seed=seed, jobs=jobs, suggested=suggested
            )
            found = []
            for scout in pool.map(search, [paths[k] for k in some]):
                found.append(scout)
                tell(SEARCH_COST, total)
            return found

        scouts = searched(chosen[:FIRST], [])
        repeated = repeated_by(scouts)
        later = searched(chosen[FIRST:], [*shared_by(scouts), *repeated])
        if later and all(names_all(scout, repeated) for scout in later) and repeated:
            total += SEARCH_COST * FIRST
            scouts = searched(chosen[:FIRST], shared_by(later))
        scouts += later
        groups = union_of(scouts)
        together = None
        if is_worth_it(groups, len(scouts)):
            total += TOGETHER_COST
            together = fit_bags([paths[k] for k in chosen], machine_path, scouts, groups, jobs)
            tell(TOGETHER_COST, total)
        sized = together.effects if together else {}
        effects = [
            sized[k][0] if k in sized else group[0][0].proposal for k, group in enumerate(groups)
        ]
        of_all = [effect for effect in effects if of_machine(effect)]
        asked = [i for i, scout in enumerate(scouts) if not names_all(scout, of_all)]
        total += len(asked)
        beside = others + [chosen[i] for i in asked]
        confirm = partial(
            confirm_bag,
            machine_path=machine_path,
            effects=effects,
            seed=seed,
            shared=together.turned if together else None,
        )
        confirmed: list[Confirmed] = []
        for one in pool.map(confirm, [paths[k] for k in beside]):
            confirmed.append(one)
            tell(1.0, total)
    confirmed, answers = confirmed[: len(others)], confirmed[len(others) :]
    silent = [
        [
            (answer.effects[k], answer.sd[k])
            for i, answer in zip(asked, answers, strict=True)
            # an instrument may fail between two recordings
            if of_machine(effect) and not names_all(scouts[i], [effect])
        ]
        for k, effect in enumerate(effects)
    ]
    rolls = [s.rolled for s in scouts] + [c.rolled for c in confirmed]
    law = law_of(
        [one for one in rolls if one is not None],
        load_machine(machine_path).tolerances.get(KNOB, 0.0),
    )
    accepted = decide(groups, len(scouts), confirmed, silent, sized)
    if together and not together.holds(accepted, groups):
        accepted = decide(groups, len(scouts), confirmed, silent)
    joint = by_speed(accepted, law, seed)
    faults = [s.faults for s in scouts] + [c.faults for c in confirmed]
    rows: dict[int, dict[str, Any]] = {
        k: {**_searched(s), 'searched': True} for k, s in zip(chosen, scouts, strict=True)
    }
    rows |= {
        k: {**_confirmed(c), 'searched': False} for k, c in zip(others, confirmed, strict=True)
    }
    by_recording = [rows[k] for k in range(n)]
    document = {
        'recordings': [row.pop('document') for row in by_recording],
        'effects': told_jointly(joint, faults, n),
        'candidates': _candidates(scouts),
        'unexplained': _unexplained([row['unexplained'] for row in by_recording]),
        'gain': joint_gain(confirmed, seed) if confirmed else _own_gain(scouts),
        'would_change': list(dict.fromkeys(line for s in scouts for line in s.would_change)),
        'by_recording': by_recording,
    }
    return document, joint


def _searched(scout: Diagnosis) -> dict[str, Any]:
    return {
        'path': scout.document['path'],
        'document': scout.document,
        'effects': scout.effects,
        'candidates': scout.candidates,
        'unexplained': rest_of(scout.unexplained),
        'gain': scout.held_out.document() if scout.held_out else None,
        'residual': scout.residual,
        'rolled': asdict(scout.rolled) if scout.rolled else None,
    }


def _confirmed(one: Confirmed) -> dict[str, Any]:
    return {
        'path': one.document['path'],
        'document': one.document,
        'effects': [_own(effect, sd) for effect, sd in zip(one.effects, one.sd, strict=True)],
        'candidates': [],
        'unexplained': rest_of(one.unexplained),
        'gain': one.held_out.document(),
        'residual': one.residual,
        'rolled': asdict(one.rolled) if one.rolled else None,
    }


def _own(effect: Proposal, sd: dict[str, float]) -> dict[str, Any]:
    """Return an effect with the size that one recording alone would give it."""
    return {**told(Found(effect, 0.0, sd, 0.0, ()), 0.0), 'probability': None}


def rest_of(rest: Unexplained) -> dict[str, Any]:
    """Return a remainder as contracts.md tells it."""
    return {'significant': rest.significant, 'share': rest.share, 'signature': rest.signature}


def _unexplained(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the largest remainder of all recordings."""
    worst = max(rows, key=lambda row: (row['significant'], row['share']))
    return {**worst, 'recordings': sum(bool(row['significant']) for row in rows)}


def _candidates(scouts: list[Diagnosis]) -> list[dict[str, Any]]:
    """Return the candidates of all searches, each once with its mean probability."""
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for scout in scouts:
        for row in scout.candidates:
            rows.setdefault((row['cause'], str(row['location'])), []).append(row)
    joint = [
        {**group[0], 'probability': sum(r['probability'] for r in group) / len(scouts)}
        for group in rows.values()
    ]
    return sorted(joint, key=lambda row: -row['probability'])[:MOST_CANDIDATES]


def _own_gain(scouts: list[Diagnosis]) -> dict[str, Any]:
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
