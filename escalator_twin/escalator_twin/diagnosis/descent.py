"""Ways down for a machine's tolerances: by slopes, and by turning one of them far."""

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from escalator_twin.diagnosis.context import Beside, Context, quiet_chi2, with_own_tolerances
from escalator_twin.diagnosis.nuisance import make_nuisance
from escalator_twin.diagnosis.regression import fit_swapped
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.machine import Deviation

MOST_STEPS = 4  # over all of the band
STEP_SHARES = (1.0, 0.4)
SETTLED = 3.0  # chi squared: a step that gains less is the last one
# Tolerances that move rollers along the guide, or the carriage, slowly; what stiffnesses and dampings of
# chain, contacts and drive do is in the short waves, and long ones have them take what is not theirs.
SLOW = ('guide.', 'experiment.', 'tensioner.', 'chain.mass', 'roller.rolling')
NEAR = 1.0  # standard deviations over which a tolerance's effect is taken
# Standard deviations by which one tolerance is turned to leave a hollow, a round each: of twelve good
# machines some are left by the one, some by the other.
KICKS = (1.2, 0.8)
WORTH_A_ROUND = 10.0  # chi squared: a turn that gains less is not followed

Free = Callable[[Beside], Beside]


@dataclass(frozen=True)
class Descent:
    """What stays the same while tolerances are tuned.

    Attributes
    ----------
    context : Context
    place : Beside
        Whose alignment is kept.
    lean : Stage
        Of that place.
    deviations : tuple of Deviation
    jobs : int
        Simulations at a time.
    held : collection of str
        Tolerances that are not turned.
    free : callable or None
        Frees the nuisance that effects of the measurement stand for.
    """

    context: Context
    place: Beside
    lean: Stage
    deviations: tuple[Deviation, ...]
    jobs: int
    held: Collection[str]
    free: Free | None

    def at(self, turned: Mapping[str, float], cut_hz: float | None = None) -> Beside:
        """Run with tolerances turned, and take anew what they do there."""
        # what is held has no column beside the recording, see `_beside`
        context = replace(self.context, weak=self.context.weak | set(self.held))
        near = with_own_tolerances(
            context, self.deviations, self.jobs, turned, NEAR, False, self.lean.origin
        )
        stage = replace(self.lean, turned=dict(turned))
        return _beside(near, self.place, stage, self.held, self.free, cut_hz)

    def descend(
        self, turned: Mapping[str, float], cut_hz: float | None = None, most: int | None = None
    ) -> tuple[Mapping[str, float], float, Beside | None]:
        """Step down by slopes; return where that ends, chi squared, and the machine where it was run.

        ``most``: steps, without it one up to a frequency.
        """
        level = inf
        for _ in range(most or (MOST_STEPS if cut_hz is None else 1)):
            start = self.at(turned, cut_hz)
            stepped = _step(start)
            if stepped is None:
                return start.stage.turned, quiet_chi2(start), start
            turned, level = stepped
            if quiet_chi2(start) - level < SETTLED:
                break
        return turned, level, None

    def follow(
        self,
        turned: Mapping[str, float],
        level: float,
        start: Beside | None,
        kicks: Sequence[float],
    ) -> tuple[Mapping[str, float], float]:
        """Turn one tolerance far, a round for each of the kicks, and step down where a way begins there."""
        for kick in kicks:
            start = start or self.at(turned)
            kicked, there = self.kicked(start, kick)
            if there < quiet_chi2(start) - WORTH_A_ROUND:
                turned, level, start = self.descend(kicked)
        return turned, level

    def kicked(self, start: Beside, by: float) -> tuple[dict[str, float], float]:
        """Return the tolerances with some turned far, those that explain most, and chi squared.

        One is turned at a time; all that act in short waves are turned back at once.
        """
        held = {*self.held, *self.context.weak}
        ways = far_turns(start.stage, by, held)
        names = [knob.name for knob in start.stage.knobs if knob.name not in held]
        ways.append({name: 0.0 for name in names if not name.startswith(SLOW)})
        return most_explaining(start, ways, self.jobs)


def far_turns(stage: Stage, by: float, held: Collection[str]) -> list[dict[str, float]]:
    """Return the turns of one tolerance each that lead far from where they are, within bounds."""
    now = stage.turned
    return [
        {knob.name: now.get(knob.name, 0.0) + kick}
        for knob in stage.knobs
        if knob.name not in held
        for kick in (-by, by)
        if abs(now.get(knob.name, 0.0) + kick) <= LARGEST
    ]


def most_explaining(
    start: Beside, ways: Sequence[Mapping[str, float]], jobs: int
) -> tuple[dict[str, float], float]:
    """Return all tolerances turned in the way that explains most, and chi squared there.

    Parameters
    ----------
    start : Beside
        The machine that is run with every way turned.
    ways : sequence of mapping of tolerance to float
        Standard deviations.
    jobs : int
        Simulations at a time.
    """
    now = start.stage.turned

    def level(way: Mapping[str, float]) -> float:
        return level_of(start, replace(start.stage, turned={**now, **way}))

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        levels = list(pool.map(level, ways))
    best = int(np.argmin(levels))
    return {**now, **ways[best]}, levels[best]


def level_of(place: Beside, stage: Stage) -> float:
    """Return chi squared of a trial: a machine as at ``place``, its tolerances turned otherwise.

    The alignment is kept while tolerances are tuned, and may be some millimetres off until they are: near
    a resonance the waves that these millimetres shift are others after a part of a standard deviation.
    What course and clocks shift is therefore the trial's own.
    """
    model = stage.run()
    left, sizes = fit_swapped(place.fitted, stage.white(model), *stage.shifts(model), stage.offset)
    return stage.level(left, sizes + stage.offset)


def _beside(
    context: Context,
    place: Beside,
    stage: Stage,
    held: Collection[str],
    free: Free | None,
    cut_hz: float | None,
) -> Beside:
    """Run a stage and fit its nuisance, up to a frequency; nothing is aligned anew."""
    model = stage.run()
    nuisance = make_nuisance(stage.observation, model, context.responses, stage.machine)
    columns = nuisance.columns.copy()
    columns[:, :, [name in held for name in nuisance.names]] = 0.0
    nuisance = replace(nuisance, columns=columns)
    white = stage.whiten(columns)
    stage = replace(stage, nuisance=nuisance, white_nuisance=white).up_to(cut_hz)
    found = replace(place, stage=stage, model=model, fitted=stage.fit(model))
    return found if free is None else free(found)


def _step(place: Beside) -> tuple[Mapping[str, float], float] | None:
    """Turn the tolerances by a step, or by a part of it, that explains more; None without one.

    Returns
    -------
    turned : mapping of tolerance to float
    level : float
        Chi squared there.
    """
    before = quiet_chi2(place)
    for share in STEP_SHARES:
        stage = place.stage.tuned(place.fitted, share)
        level = level_of(place, stage)
        if level < before:
            return stage.turned, level
    return None
