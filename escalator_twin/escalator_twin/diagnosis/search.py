"""What every family of causes needs to look for itself by linear responses."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf, pi

from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.view import View
from escalator_twin.diagnosis.whitening import Whitener
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats

SIDES = ('left', 'right')
KEEP = 4  # places of one cause that go on to be simulated
WORTH = 0.35  # of the best proposal's gain, from which a proposal is simulated


@dataclass(frozen=True)
class Search:
    """All that a family of causes needs to look for itself.

    Attributes
    ----------
    view : View
    fitted : Fitted
        The residual with its nuisance.
    stage : Stage
    model : (n, c) float64
        The stage's model, of which the residual is.
    jobs : int
        Simulations at a time.
    is_open : bool
        More is left than in a good machine: searches that cost much are worth it.
    least : float
        Gain below which a proposal will not be simulated, by what is proposed already.
    excess : float
        Chi squared above a good machine's.
    """

    view: View
    fitted: Fitted
    stage: Stage
    model: Floats
    jobs: int = 1
    is_open: bool = True
    least: float = 0.0
    excess: float = inf

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the nuisance."""
        return self.stage.nuisance.names

    @property
    def machine(self) -> Machine:
        """The machine as known so far."""
        return self.stage.machine

    @property
    def whiten(self) -> Whitener:
        """What weighs the signals."""
        return self.stage.whiten

    def among(self, channels: Sequence[int]) -> tuple[Fitted, Whitener]:
        """Return fit and whitener of some channels, for candidates that change no other.

        Their products with all else are the same, at a part of the cost.
        """
        count, q = self.model.shape[1], self.fitted.columns.shape[1]
        some = list(channels)
        columns = self.fitted.columns.reshape(-1, count, q)[:, some].reshape(-1, q)
        white = self.fitted.white.reshape(-1, count)[:, some].ravel()
        whiten = self.stage.whiten
        alone = replace(whiten, mask=whiten.mask[:, some], weight=whiten.weight[:, some])
        return replace(self.fitted, columns=columns, white=white), alone


Family = Callable[[Search], Iterator[Proposal]]


def best(proposals: list[Proposal], count: int = KEEP) -> list[Proposal]:
    """Return the proposals that explain most."""
    return sorted(proposals, key=lambda p: -p.gain)[:count]


def from_softening(size: float) -> float:
    """Return the stiffness factor of an added compliance, relative to the own one."""
    return 1.0 / max(1.0 + size, 0.05)


def wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return float((angle + pi) % (2.0 * pi) - pi)


def search_all(
    search: Search, families: Sequence[Family], costly: Sequence[Family] = ()
) -> list[Proposal]:
    """Return what some families propose, best first.

    Parameters
    ----------
    search : Search
    families : sequence of Family
    costly : sequence of Family
        Those that run the twin: they are told what the others propose, and may leave it at that.
    """
    found = _in_parallel(search, families)
    most = max((p.gain for p in found if of_machine(p)), default=0.0)
    found += _in_parallel(replace(search, least=WORTH * most), costly)
    return sorted(found, key=lambda p: -p.gain)


def _in_parallel(search: Search, families: Sequence[Family]) -> list[Proposal]:
    with ThreadPoolExecutor(max(1, search.jobs)) as pool:
        proposed = pool.map(lambda family: list(family(search)), families)
        return [proposal for proposals in proposed for proposal in proposals]
