"""The walk from a bag to an answer: every arrow is one call."""

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from escalator_twin import bagfile
from escalator_twin.causes.registry import KNOWN
from escalator_twin.comparison.document import recording_document, SCHEMA
from escalator_twin.comparison.judge import judge, Judgement
from escalator_twin.comparison.locate import locate, RATE_HZ, Setting
from escalator_twin.comparison.parts import compare_in_parts, part_bounds
from escalator_twin.diagnosis.campaign import pooled
from escalator_twin.diagnosis.diagnose import diagnose_recording, Diagnosis
from escalator_twin.diagnosis.extension import extension, write_extension
from escalator_twin.errors import EscalatorError
from escalator_twin.instruments import ideal, record
from escalator_twin.machine import load_machine, Machine
from escalator_twin.signals import Experiment, Recording
from escalator_twin.twin import make_simulation, Progress, run_twin

MODELS = {'two_sided': False, 'planar': True}


def simulate_to_bag(
    machine_path: str | Path,
    experiment: Experiment,
    duration_s: float,
    start_s: float,
    out: str | Path,
    instruments: str = 'ideal',
    seed: int = 0,
    model: str | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run the twin and write what its instruments read as a rosbag2 directory.

    Parameters
    ----------
    machine_path : path
    experiment : Experiment
    duration_s, start_s : float
        Length of the recording, s, and path coordinate of axle 0 at its first sample, m.
    out : path
        A directory that does not exist yet.
    instruments : {'ideal', 'real'}
        Exact values on one clock, or with the data sheet's imperfections.
    seed : int
        Of the imperfections.
    model : {'two_sided', 'planar'}, optional
    progress : callable, optional
        Gets (done, total).
    """
    machine = load_machine(machine_path)
    if (model or 'two_sided') not in MODELS:
        raise EscalatorError(f'model: expected one of {", ".join(MODELS)}, found {model!r}')
    simulation = make_simulation(machine, experiment, MODELS[model or 'two_sided'])
    sensors = machine.instruments.sensors + machine.instruments.simulated_only
    trace = run_twin(simulation, sensors, start_s, duration_s, RATE_HZ, progress)
    if instruments == 'ideal':
        recording = ideal(trace, machine, experiment)
    else:
        recording = record(trace, machine, experiment, seed)
    bagfile.write(out, recording, machine, machine.instruments.simulated_namespace)
    return {
        'schema': 'escalator_twin/simulate/1',
        'path': str(out),
        'machine': machine.name,
        'duration_s': duration_s,
        'start_s_m': start_s,
        'instruments': instruments,
        'seed': seed,
        'channels': {c: len(s.values) for c, s in recording.signals.items()},
    }


def compare_recording(
    recording: Recording, machine: Machine, progress: Progress | None = None
) -> tuple[Setting, Judgement]:
    """Place one recording, run the twin beside it, score the agreement."""
    setting = locate(recording, machine)
    simulation = make_simulation(machine, setting.experiment)
    trace = run_twin(
        simulation,
        machine.instruments.sensors,
        setting.start_s_m,
        setting.duration_s,
        RATE_HZ,
        progress,
    )
    return setting, judge(setting, trace, machine)


def compare_bag(path: str, machine_path: str | Path) -> dict[str, Any]:
    """Return one recording's part of the JSON of ``compare``."""
    machine = load_machine(machine_path)
    if bounds := part_bounds(path, machine):
        return compare_in_parts(path, machine, bounds)
    recording = bagfile.read(path, machine)
    setting, judgement = compare_recording(recording, machine)
    return recording_document(recording, setting, judgement, machine)


def compare(
    paths: list[str],
    machine_path: str | Path,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Compare recordings with the twin; the JSON document of contracts.md.

    Parameters
    ----------
    paths : list of str
        rosbag2 directories or files.
    machine_path : path
    seed : int
        Comparison draws no random numbers; kept for one interface of all verbs.
    jobs : int
        Processes at once.
    progress : callable, optional
        Gets (done, total) in recordings.
    """
    del seed
    machine_path = str(machine_path)
    documents = []
    if jobs > 1 and len(paths) > 1:
        with ProcessPoolExecutor(min(jobs, len(paths))) as pool:
            for document in pool.map(compare_bag, paths, [machine_path] * len(paths)):
                documents.append(document)
                if progress is not None:
                    progress(len(documents), len(paths))
    else:
        for path in paths:
            documents.append(compare_bag(path, machine_path))
            if progress is not None:
                progress(len(documents), len(paths))
    return {'schema': SCHEMA, 'machine': machine_path, 'recordings': documents}


def diagnose(
    paths: list[str],
    machine_path: str | Path,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
    out: str | Path | None = None,
) -> dict[str, Any]:
    """Name the causes of disagreement, extend the machine, measure the gain.

    Parameters
    ----------
    paths : list of str
        Recordings of one machine.
    machine_path : path
    seed : int
        Of the bootstrap of the gain's interval.
    jobs : int
        Simulations, or recordings, at once.
    progress : callable, optional
        Gets (done, total).
    out : path, optional
        The extended machine's file; ``<machine>_extended.yaml`` in the working directory where
        it is not given.

    Raises
    ------
    RecordingError, SynchronisationError
        Where a recording lacks what is needed.
    """
    machine = load_machine(machine_path)
    target = Path(out) if out is not None else Path(f'{machine.name}_extended.yaml')
    found = _diagnose_all(paths, str(machine_path), seed, jobs, progress)
    single = len(found) == 1
    effects = found[0].effects if single else pooled([d.effects for d in found])
    deviations = _accepted(effects, found, single)
    description = extension(machine, target.parent, paths, effects, deviations, seed)
    write_extension(target, description)
    return {
        'schema': 'escalator_twin/diagnosis/1',
        'machine': str(machine_path),
        'recordings': [d.document for d in found],
        'effects': effects,
        'candidates': _joint_candidates(found),
        'unexplained': _joint_unexplained(found),
        'extended_machine': str(target),
        'extended_machine_yaml': target.read_text(encoding='utf-8'),
        'gain': _joint_gain(found),
        'by_recording': [
            {
                'path': d.document['path'],
                'effects': d.effects,
                'candidates': d.candidates,
                'unexplained': _rest(d),
                'gain': d.held_out.document() if d.held_out else None,
            }
            for d in found
        ],
    }


def _diagnose_all(
    paths: list[str], machine_path: str, seed: int, jobs: int, progress: Progress | None
) -> list[Diagnosis]:
    """Diagnose every recording by itself, several at once where there are several."""
    if len(paths) == 1:
        return [diagnose_bag(paths[0], machine_path, seed, jobs, progress)]
    found = []
    with ProcessPoolExecutor(max(1, min(jobs, len(paths)))) as pool:
        count = len(paths)
        results = pool.map(diagnose_bag, paths, [machine_path] * count, [seed] * count)
        for result in results:
            found.append(result)
            if progress is not None:
                progress(len(found), count)
    return found


def diagnose_bag(
    path: str,
    machine_path: str,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose one recording."""
    machine = load_machine(machine_path)
    return diagnose_recording(bagfile.read(path, machine), machine, seed, jobs, progress)


def _accepted(
    effects: list[dict[str, Any]], found: list[Diagnosis], single: bool
) -> list[dict[str, Any]]:
    """Return the accepted effects of the machine as deviations of a description."""
    if single:
        return [
            {
                'cause': d.cause,
                **({'location': dict(d.location)} if d.location else {}),
                'parameters': dict(d.parameters),
            }
            for d in found[0].deviations
        ]
    return [
        {
            'cause': e['cause'],
            **({'location': dict(e['location'])} if e['location'] else {}),
            'parameters': {name: p['value'] for name, p in e['parameters'].items()},
        }
        for e in effects
        if KNOWN[e['cause']].of_machine
    ]


def _rest(diagnosis: Diagnosis) -> dict[str, Any]:
    rest = diagnosis.unexplained
    return {
        'significant': rest.significant,
        'share': rest.share,
        'signature': rest.signature,
    }


def _joint_unexplained(found: list[Diagnosis]) -> dict[str, Any]:
    """Return the largest remainder of all recordings."""
    rows = [_rest(d) for d in found]
    worst = max(rows, key=lambda row: (row['significant'], row['share']))
    if len(rows) == 1:
        return worst
    return {**worst, 'recordings': sum(bool(row['significant']) for row in rows)}


def _joint_candidates(found: list[Diagnosis]) -> list[dict[str, Any]]:
    """Return the candidates of all recordings, each once with its mean probability."""
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for diagnosis in found:
        for row in diagnosis.candidates:
            rows.setdefault((row['cause'], str(row['location'])), []).append(row)
    joint = [
        {**group[0], 'probability': sum(r['probability'] for r in group) / len(found)}
        for group in rows.values()
    ]
    return sorted(joint, key=lambda row: -row['probability'])[:40]


def _joint_gain(found: list[Diagnosis]) -> dict[str, Any]:
    """Return the held-out gain: a recording's own, or the mean over recordings."""
    held = [d.held_out for d in found if d.held_out is not None]
    seen = [h for h in held if h.channels is not None]
    if not held:
        return {'held_out': None, 'split': 'nothing was accepted'}
    if not seen:
        return {'held_out': None, 'split': held[0].split}
    if len(found) == 1:
        return {'held_out': seen[0].document(), 'split': seen[0].split}
    names = {name for h in seen for name in h.channels or {}}
    channels = {}
    for name in sorted(names):
        rows = [h.channels[name] for h in seen if h.channels and name in h.channels]
        channels[name] = {key: sum(r[key] for r in rows) / len(rows) for key in rows[0]}
    document = {
        'split': f'{len(seen)} recordings, each: {seen[0].split}',
        'blocks': sum(h.blocks for h in seen),
        'channels': channels,
        'significant': all(h.significant for h in seen),
    }
    return {'held_out': document, 'split': document['split']}
