"""Diagnose several recordings of one machine: some searched in full, the others as their proof."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from escalator_twin import bagfile
from escalator_twin.comparison.locate import checked
from escalator_twin.diagnosis.campaign import decide, Joint, union_of
from escalator_twin.diagnosis.confirm import confirm_recording, Confirmed
from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.diagnose import diagnose_recording, Diagnosis
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.free import any_local, of_machine
from escalator_twin.diagnosis.jointly import by_speed, joint_gain, told_jointly
from escalator_twin.diagnosis.leftovers import names_all, perhaps_of, repeated_by
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.recordings import (
    confirmed_row,
    judged,
    largest_rest,
    mean_candidates,
    own_gain,
    searched_row,
)
from escalator_twin.diagnosis.scouts import choose_scouts, FIRST, shared_by
from escalator_twin.diagnosis.speeds import KNOB, law_of
from escalator_twin.diagnosis.suggested import NOTHING, Suggested
from escalator_twin.diagnosis.together import (
    fitted_together,
    Groups,
    is_worth_it,
    needs_no_phase,
    Together,
)
from escalator_twin.machine import load_machine, MultibodyMachine
from escalator_twin.signals import Experiment
from escalator_twin.threads import one_thread_each

# Of a full search, and of the fit of all searched recordings together, in confirmations: for the progress alone.
SEARCH_COST, TOGETHER_COST = 3.0, 3.0
One = TypeVar('One')
Progress = Callable[[float, float], None]


def diagnose_bag(
    path: str,
    machine_path: str,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
    suggested: Suggested = NOTHING,
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
    scouts: Sequence[Diagnosis | None],
    groups: Groups,
    jobs: int = 1,
) -> Together | None:
    """Fit what searches name to all of their recordings that have a certain place; see `fitted_together`."""
    machine = load_machine(machine_path)
    floor = load_floor(machine)

    def context_of(path: str) -> Context:
        return prepare_tolerances(bagfile.read(path, machine), machine, floor)

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        contexts = list(pool.map(context_of, paths))
    placed = [k for k, context in enumerate(contexts) if context.setting.is_certain]
    if not any(scouts[k] for k in placed):
        return None
    return fitted_together(
        [contexts[k] for k in placed], [scouts[k] for k in placed], groups, jobs
    )


def experiment_of(path: str, machine_path: str) -> Experiment:
    """Return what was set when a recording was made.

    Raises
    ------
    RecordingError, SynchronisationError
        Where it cannot be placed: known before the work on the others is lost to it.
    """
    machine = load_machine(machine_path)
    return checked(bagfile.read(path, machine), machine)


@dataclass(frozen=True)
class Looked:
    """What was found out of recordings, by their numbers.

    Attributes
    ----------
    groups : list of groups
        As `union_of` gives them.
    scouts : mapping of int to Diagnosis
        That were searched.
    confirmed : mapping of int to Confirmed
        That were put beside what the scouts name.
    together : Together or None
    fitted : frozenset of int
        Those that sizes were fitted to.
    """

    groups: Groups
    scouts: Mapping[int, Diagnosis]
    confirmed: Mapping[int, Confirmed]
    together: Together | None
    fitted: frozenset[int]


class Work:
    """Runs what is asked of single recordings, several at a time.

    Parameters
    ----------
    paths, machine_path, seed, jobs
        As of `diagnose_together`.
    progress : callable or None
    pool : Executor
    """

    def __init__(
        self,
        paths: Sequence[str],
        machine_path: str,
        seed: int,
        jobs: int,
        progress: Progress | None,
        pool: Executor,
    ) -> None:
        self.paths, self.machine_path = list(paths), machine_path
        self.seed, self.jobs, self.pool = seed, jobs, pool
        self._progress, self._done, self.total = progress, 0.0, 1.0

    def experiments(self) -> list[Experiment]:
        return list(
            self.pool.map(experiment_of, self.paths, [self.machine_path] * len(self.paths))
        )

    def search(self, some: Sequence[int], suggested: Suggested = NOTHING) -> dict[int, Diagnosis]:
        """Search recordings, all of them with what is suggested to begin with."""
        # each with all jobs: one may end long before the other, and two are fewer than many cores
        one = partial(
            diagnose_bag,
            machine_path=self.machine_path,
            seed=self.seed,
            jobs=self.jobs,
            suggested=suggested,
        )
        return self._each(one, some, SEARCH_COST)

    def confirm(
        self, some: Sequence[int], groups: Groups, together: Together | None
    ) -> dict[int, Confirmed]:
        """Put effects beside recordings."""
        one = partial(
            confirm_bag,
            machine_path=self.machine_path,
            effects=effects_of(groups, together),
            seed=self.seed,
            shared=together.turned if together else None,
        )
        return self._each(one, some, 1.0)

    def fit(
        self, some: Sequence[int], scouts: Mapping[int, Diagnosis], groups: Groups
    ) -> tuple[Together | None, frozenset[int]]:
        """Fit what scouts name to several recordings at once; return which these are as well."""
        n_judged = len(judged(list(scouts.values())))
        if not is_worth_it(groups, n_judged):
            return None, frozenset()
        chosen = some if needs_no_phase(groups, n_judged) else list(scouts)
        found = fit_bags(
            [self.paths[k] for k in chosen],
            self.machine_path,
            [scouts.get(k) for k in chosen],
            groups,
            self.jobs,
        )
        self.tell(TOGETHER_COST)
        return found, frozenset(chosen if found else ())

    def _each(self, do: Callable[[str], One], some: Sequence[int], cost: float) -> dict[int, One]:
        found = {}
        rows = self.pool.map(do, [self.paths[k] for k in some])
        for k, one in zip(some, rows, strict=True):
            found[k] = one
            self.tell(cost)
        return found

    def tell(self, cost: float) -> None:
        self._done += cost
        self.total = max(self.total, self._done)
        if self._progress is not None:
            self._progress(self._done, self.total)


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
    machine = load_machine(machine_path)
    is_linked = not isinstance(machine, MultibodyMachine)
    with ProcessPoolExecutor(max(1, min(jobs, n))) as pool:
        work = Work(paths, machine_path, seed, jobs, progress, pool)
        experiments = work.experiments()
        chosen = choose_scouts(experiments) if is_linked else list(range(n))
        work.total = SEARCH_COST * len(chosen) + TOGETHER_COST + n - len(chosen)
        looked = look_together(work, chosen) if is_linked else search_all(work)
        effects = effects_of(looked.groups, looked.together)
        of_all = [effect for effect in effects if of_machine(effect)]
        asked = [
            k for k, scout in looked.scouts.items() if is_linked and not names_all(scout, of_all)
        ]
        answers = work.confirm(asked, looked.groups, looked.together)
    silent = [
        [
            (answer.effects[i], answer.sd[i])
            for k, answer in answers.items()
            # an instrument may fail between two recordings
            if of_machine(effect) and not names_all(looked.scouts[k], [effect])
        ]
        for i, effect in enumerate(effects)
    ]
    scouts = list(looked.scouts.values())
    confirmed = list(looked.confirmed.values())
    rolls = [s.rolled for s in scouts] + [c.rolled for c in confirmed]
    law = law_of([one for one in rolls if one is not None], machine.tolerances.get(KNOB, 0.0))
    together = looked.together
    sizes = together.effects if together else {}
    n_judged = len(judged(scouts))
    accepted = decide(looked.groups, n_judged, confirmed, silent, sizes)
    if together and not together.holds(accepted, looked.groups):
        accepted = decide(looked.groups, n_judged, confirmed, silent)
    joint = by_speed(accepted, law, seed)
    faults = [s.faults for s in scouts] + [c.faults for c in confirmed]
    rows = {k: searched_row(s) for k, s in looked.scouts.items()}
    rows |= {k: confirmed_row(c) for k, c in looked.confirmed.items()}
    seen = looked.fitted | looked.scouts.keys()
    by_recording = [
        {**rows[k], 'fitted': k in seen and rows[k]['document']['place_is_certain']}
        for k in range(n)
    ]
    unseen = [c for k, c in looked.confirmed.items() if k not in seen]
    document = {
        'recordings': [row.pop('document') for row in by_recording],
        'effects': told_jointly(joint, faults, n),
        'candidates': mean_candidates(scouts),
        'unexplained': largest_rest([row['unexplained'] for row in by_recording]),
        'gain': joint_gain(unseen, seed) if unseen else own_gain(scouts),
        'would_change': list(dict.fromkeys(line for s in scouts for line in s.would_change)),
        'by_recording': by_recording,
    }
    return document, joint


def look_together(work: Work, chosen: Sequence[int]) -> Looked:
    """Search some recordings and put what they name beside all others.

    The first two are searched with nothing suggested. Where both name the same of the machine, it is put beside the others that were
    chosen, and these are searched only where it leaves something open; else they are in any case. So they are beside
    single links or waves of the drive: where something is left open the fit is made twice, and that takes longer than these searches.

    Parameters
    ----------
    work : Work
    chosen : sequence of int
        Those whose experiments differ most.
    """
    first, rest = chosen[:FIRST], chosen[FIRST:]
    scouts = work.search(first)
    repeated = repeated_by(list(scouts.values()))
    suggested = shared_by(list(scouts.values()))
    groups = union_of(list(scouts.values()))
    named = [group[0][0].proposal for group in groups]
    confirmed: dict[int, Confirmed] = {}
    together, fitted = None, frozenset[int]()
    if rest and not repeated and _agree(list(scouts.values()), groups) and not any_local(named):
        together, fitted = work.fit(chosen, scouts, groups)
        confirmed = work.confirm(rest, groups, together)
        rest = [k for k in rest if confirmed[k].is_open]
    # beside single links a search takes long
    perhaps = perhaps_of(list(scouts.values())) if any_local(named) else []
    later = work.search(rest, Suggested((*suggested, *repeated), tuple(perhaps)))
    if repeated and later and all(names_all(scout, repeated) for scout in later.values()):
        work.total += SEARCH_COST * len(first)
        scouts = work.search(first, Suggested(tuple(shared_by(list(later.values())))))
    if later or not confirmed:
        scouts |= later
        groups = union_of(list(scouts.values()))
        together, fitted = work.fit(chosen, scouts, groups)
        confirmed = {}
    others = [k for k in range(len(work.paths)) if k not in scouts and k not in confirmed]
    confirmed |= work.confirm(others, groups, together)
    return Looked(groups, scouts, confirmed, together, fitted)


def search_all(work: Work) -> Looked:
    """Search every recording of a machine of free bodies: nothing else is known of how to put effects beside it."""
    every = range(len(work.paths))
    scouts = work.search(every[:FIRST])
    suggested = Suggested(tuple(shared_by(list(scouts.values()))))
    scouts |= work.search(every[FIRST:], suggested)
    groups = union_of(list(scouts.values()))
    return Looked(groups, scouts, {}, None, frozenset())


def effects_of(groups: Groups, together: Together | None) -> list[Proposal]:
    """Return one effect of each group: as fitted together, or as the surest search has it."""
    sized = together.effects if together else {}
    return [sized[k][0] if k in sized else g[0][0].proposal for k, g in enumerate(groups)]


def _agree(scouts: Sequence[Diagnosis], groups: Groups) -> bool:
    """Tell whether searches name the same effects of the machine, at least one."""
    effects = [g[0][0].proposal for g in groups if of_machine(g[0][0].proposal)]
    return bool(effects) and all(names_all(scout, effects) for scout in scouts)
