"""The walk from a bag to an answer: every arrow is one call."""

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from escalator_twin import bagfile
from escalator_twin.campaign import diagnose_bag, diagnose_together
from escalator_twin.causes.registry import KNOWN
from escalator_twin.comparison.document import recording_document, SCHEMA
from escalator_twin.comparison.judge import judge, Judgement
from escalator_twin.comparison.locate import locate, RATE_HZ, Setting
from escalator_twin.comparison.parts import compare_in_parts, part_bounds
from escalator_twin.diagnosis.diagnose import Diagnosis
from escalator_twin.diagnosis.extension import extension, write_extension
from escalator_twin.diagnosis.recordings import rest_of
from escalator_twin.errors import EscalatorError
from escalator_twin.instruments import ideal, record
from escalator_twin.machine import Deviation, load_machine, Machine
from escalator_twin.memory import keep_freed
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
    keep_freed()
    machine = load_machine(machine_path)
    target = Path(out) if out is not None else Path(f'{machine.name}_extended.yaml')
    if len(paths) == 1:
        single = diagnose_bag(paths[0], str(machine_path), seed, jobs, progress)
        document, deviations = _document(single), single.deviations
    else:
        document, joint = diagnose_together(paths, str(machine_path), seed, jobs, progress)
        deviations = tuple(
            j.found.proposal.deviation for j in joint if KNOWN[j.found.proposal.cause].of_machine
        )
    accepted = [_written(deviation) for deviation in deviations]
    description = extension(machine, target.parent, paths, document['effects'], accepted, seed)
    write_extension(target, description)
    return {
        'schema': 'escalator_twin/diagnosis/1',
        'machine': str(machine_path),
        **document,
        'extended_machine': str(target),
        'extended_machine_yaml': target.read_text(encoding='utf-8'),
    }


def _document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return one recording's diagnosis as the JSON has it."""
    held = diagnosis.held_out
    if held is None:
        gain: dict[str, Any] = {'held_out': None, 'split': 'nothing was accepted'}
    else:
        gain = {'held_out': held.document(), 'split': held.split}
    rest = rest_of(diagnosis.unexplained)
    return {
        'recordings': [diagnosis.document],
        'effects': diagnosis.effects,
        'candidates': diagnosis.candidates,
        'unexplained': rest,
        'gain': gain,
        'would_change': diagnosis.would_change,
        'by_recording': [
            {
                'path': diagnosis.document['path'],
                'effects': diagnosis.effects,
                'candidates': diagnosis.candidates,
                'unexplained': rest,
                'gain': held.document() if held else None,
                'residual': diagnosis.residual,
            }
        ],
    }


def _written(deviation: Deviation) -> dict[str, Any]:
    """Return a deviation as a machine description has it."""
    return {
        'cause': deviation.cause,
        **({'location': dict(deviation.location)} if deviation.location else {}),
        'parameters': dict(deviation.parameters),
    }
