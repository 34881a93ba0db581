"""One recording's diagnosis, from the bag's signals to the numbers of contracts.md."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from escalator_twin.comparison.document import recording_document
from escalator_twin.comparison.judge import judge
from escalator_twin.comparison.locate import locate, Setting
from escalator_twin.diagnosis.bodies.context import prepare as prepare_bodies
from escalator_twin.diagnosis.bodies.running import whole_trace
from escalator_twin.diagnosis.bodies.search import FREE_BODIES
from escalator_twin.diagnosis.conclusion import conclude, NAMED
from escalator_twin.diagnosis.context import Context, quiet_chi2
from escalator_twin.diagnosis.faults import Fault, faults_of
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.linked import LINKED
from escalator_twin.diagnosis.preparation import prepare
from escalator_twin.diagnosis.scores import HeldOut
from escalator_twin.diagnosis.speeds import Rolled, rolled
from escalator_twin.diagnosis.split import split
from escalator_twin.diagnosis.stage import run_beside
from escalator_twin.diagnosis.suggested import NOTHING, Suggested
from escalator_twin.diagnosis.telling import (
    candidates,
    no_place,
    told,
    told_fault,
    weighed_fault,
    would_change,
)
from escalator_twin.diagnosis.unexplained import look, NOT_JUDGED, Unexplained
from escalator_twin.diagnosis.walk import walk
from escalator_twin.diagnosis.walked import Bench
from escalator_twin.diagnosis.within import within_tolerance
from escalator_twin.errors import NotYetError
from escalator_twin.machine import Deviation, Machine, MultibodyMachine
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Recording
from escalator_twin.threads import one_thread_each

Progress = Callable[[float, float], None]
STAGES = 10.0


@dataclass(frozen=True)
class Diagnosis:
    """What was found in one recording.

    Attributes
    ----------
    document : mapping
        The recording's part of the comparison, before extension.
    effects : list of mapping
        Accepted, strongest first, as contracts.md tells them.
    candidates : list of mapping
    unexplained : Unexplained
    deviations : tuple of Deviation
        Accepted effects of the machine.
    held_out : HeldOut or None
        None where nothing was accepted.
    faults : tuple of Fault
    found : tuple of (Found, probability)
        All effects that the walk accepted, named or not.
    residual : mapping
        What is left without and with the effects, by channel, see `split`.
    would_change : list of str
        What would change the verdict.
    rolled : Rolled or None
        What the recording says of its rollers, by which several speeds are compared.
    left : Found or None
        See `Walked`.
    level : float
        Chi squared beside all that was found, in the channels that no rattling shakes.
    turned : mapping of tolerance to float
        Where the tolerances are beside all that was found, standard deviations.
    is_placed : bool
        Without a certain place in the loop nothing of the machine was sought.
    """

    document: dict[str, Any]
    effects: list[dict[str, Any]]
    candidates: list[dict[str, Any]]
    unexplained: Unexplained
    deviations: tuple[Deviation, ...]
    held_out: HeldOut | None
    faults: tuple[Fault, ...]
    found: tuple[tuple[Found, float], ...] = ()
    residual: dict[str, Any] = field(default_factory=dict)
    would_change: list[str] = field(default_factory=list)
    rolled: Rolled | None = None
    left: Found | None = None
    level: float = 0.0
    turned: Mapping[str, float] = field(default_factory=dict)
    is_placed: bool = True


@one_thread_each
def diagnose_recording(
    recording: Recording,
    machine: Machine,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
    suggested: Suggested = NOTHING,
) -> Diagnosis:
    """Diagnose one recording.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    seed : int
        Of the bootstrap; nothing else is drawn.
    jobs : int
        Simulations at a time.
    progress : callable, optional
        Gets (done, total).
    suggested : Suggested
        See `walk`.

    Raises
    ------
    NotYetError
        On a machine of free bodies whose twin's own error was not measured.
    """

    def tell(done: float, total: float) -> None:
        if progress is not None:
            progress(1.0 + 5.0 * done / total, STAGES)

    setting = None
    if not isinstance(machine, MultibodyMachine):
        setting = locate(recording, machine)
        if not setting.is_certain:
            return unplaced(recording, machine, setting)
    context, trace, bench = _placed(recording, machine, jobs, tell, setting)
    judgement = judge(context.setting, trace, machine)
    document = recording_document(recording, context.setting, judgement, machine)
    walked = walk(context, jobs, bench=bench, suggested=suggested)
    if progress is not None:
        progress(9.0, STAGES)
    faults = tuple(faults_of(context.setting, machine))
    before = bench.bare(walked.before, [found.proposal for found in walked.found])
    rest = look(context, before, walked.after)
    walked, rest = within_tolerance(context, walked, rest, bench, jobs)
    named, held, rest, after = conclude(context, walked, rest, seed, bench, jobs)
    if progress is not None:
        progress(STAGES, STAGES)
    effects = [told(found, p) for found, p in named if p >= NAMED]
    effects += [told_fault(fault) for fault in faults]
    kept = [found.proposal for found, p in named if p >= NAMED and of_machine(found.proposal)]
    return Diagnosis(
        document,
        sorted(effects, key=lambda e: -e['probability']),
        candidates(walked, named, faults),
        rest,
        tuple(proposal.deviation for proposal in kept),
        held,
        faults,
        tuple(named),
        {'before': split(context, walked.before), 'after': split(context, after)},
        would_change(context, walked, named, held, bench.decide),
        rolled(walked.after, [(f.proposal, f.sd) for f in walked.found])
        if bench is LINKED
        else None,
        walked.left,
        quiet_chi2(walked.after),
        walked.after.stage.turned,
    )


def unplaced(recording: Recording, machine: Machine, setting: Setting) -> Diagnosis:
    """Return what can be said of a recording whose place in the loop is not certain.

    Beside a machine that is a pitch away everything differs: only faults of the measurement that show without it
    are told.
    """
    judgement = judge(setting, run_beside(machine, setting.experiment, setting), machine)
    faults = sorted(faults_of(setting, machine), key=lambda fault: -fault.probability)
    return Diagnosis(
        recording_document(recording, setting, judgement, machine),
        [told_fault(fault) for fault in faults],
        [weighed_fault(fault) for fault in faults],
        NOT_JUDGED,
        (),
        None,
        tuple(faults),
        would_change=[no_place(setting)],
        is_placed=False,
    )


def _placed(
    recording: Recording, machine: Machine, jobs: int, tell: Progress, setting: Setting | None
) -> tuple[Context, Trace, Bench]:
    """Place a recording; return it, the machine's run beside it, and what its kind needs."""
    floor = load_floor(machine)
    if isinstance(machine, MultibodyMachine):
        if not floor.levels:  # beside the sensors' noise alone, the twin's own error gets names
            raise NotYetError(
                f"diagnose: {machine.name}: the twin's own error was not measured: no "
                f'{machine.name}_floor.yaml beside {machine.source} (diagnosis.bodies.calibrate)'
            )
        found = prepare_bodies(recording, machine, floor, jobs, tell)
        return found, whole_trace(machine, found.runs), FREE_BODIES
    context = prepare(recording, machine, floor, jobs, tell, setting)
    return context, run_beside(machine, context.setting.experiment, context.setting), LINKED
