"""A machine made of waves, in which an axle shows while it passes: truth for held-out gain."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import trials

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.heldout import hold_out
from escalator_twin.diagnosis.nuisance import Nuisance
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.whitening import make_whitener, sensor_variance, Whitener

MACHINE = trials.prototype()
CHANNELS = tuple(s.channel for s in MACHINE.instruments.sensors)
FORCES = np.array([c.startswith('link_force') for c in CHANNELS])
TENSIONER = CHANNELS.index('tensioner/displacement')
FRAME = Frame.of(MACHINE, 0.5)
GUARD = 2 * FRAME.per_pitch  # two pitches, issue 7
LOOPS = 1.75
AXLE, OTHER = 7, 30
SIZE = 20.0  # standard deviations of the sensors' noise


def effect(axle: int = AXLE) -> Proposal:
    place: dict[str, object] = {'axle': axle, 'side': 'left'}
    return Proposal('roller_drag', place, {'force_N': 120.0}, 1e4, fitted=('force_N',))


EVERYWHERE = Proposal('tensioner_friction', {}, {'force_N': 150.0}, 1e4, fitted=('force_N',))


def spread() -> np.ndarray:
    """Return the standard deviation of every channel's noise."""
    sensors = [MACHINE.instruments.sensor(c) for c in CHANNELS]
    return np.array([sensor_variance(s, FRAME.rate_hz) ** 0.5 for s in sensors])


def passing(n: int, axle: int) -> np.ndarray:
    """Return what an axle does to all forces while it passes three pitches of the loop, (n, c)."""
    place = (np.arange(n) + axle * FRAME.per_pitch) % FRAME.n_loop / FRAME.per_pitch
    bump = np.exp(-0.5 * ((place - 20.0) / 1.5) ** 2) * np.sin(2.0 * np.pi * 0.7 * place)
    return SIZE * bump[:, None] * FORCES * spread()


@dataclass(frozen=True)
class Still(Stage):
    """A stage whose machine's signals are given."""

    base: np.ndarray | None = None

    def run(self, *_):
        return self.base


@dataclass(frozen=True)
class Remembering(Whitener):
    """A whitener that keeps which samples it was shown."""

    shown: Callable[[np.ndarray], None] = print

    def __call__(self, signals):
        self.shown(self.mask[:, 0] > 0.0)
        return super().__call__(signals)


def stage_of(measured: np.ndarray, base: np.ndarray, shown=None) -> Still:
    n, c = measured.shape
    time = np.tile(np.arange(n)[:, None] / FRAME.rate_hz, (1, c))
    observation = Observation(
        FRAME, CHANNELS, np.arange(n), time, measured, np.ones((n, c), bool), 0.0
    )
    columns = np.zeros((n, c, c), np.float32)
    for k, sd in enumerate(spread()):
        columns[:, k, k] = 1e3 * sd
    whiten = make_whitener(observation, MACHINE, Floor({}))
    if shown is not None:
        whiten = Remembering(whiten.mask, whiten.weight, whiten.temperature, shown)
    nuisance = Nuisance(tuple(f'{channel}/zero' for channel in CHANNELS), columns)
    white = make_whitener(observation, MACHINE, Floor({}))(columns)
    return Still(
        MACHINE, SimpleNamespace(), observation, nuisance, whiten, white, (), {}, 0.0, base=base
    )


def recorded(seed: int = 1, loops: float = LOOPS) -> tuple[np.ndarray, np.ndarray]:
    """Return measured and simulated signals of a machine with a drag at one axle, (n, c)."""
    n = round(loops * FRAME.n_loop)
    rng = np.random.default_rng(seed)
    pitches = np.arange(n)[:, None] / FRAME.per_pitch
    base = 50.0 * spread() * np.sin(2.0 * np.pi * pitches + rng.uniform(0.0, 6.0, len(CHANNELS)))
    noise = spread() * rng.normal(size=base.shape)
    return base + passing(n, AXLE) + noise, base


def held(change: np.ndarray, proposal: Proposal, seed: int = 1, shown=None):
    measured, base = recorded(seed)
    stage = stage_of(measured, base, shown)
    after = Beside(stage, None, base + change, stage.fit(base + change))
    return hold_out(SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [proposal], seed)


N = round(LOOPS * FRAME.n_loop)


def blow(n: int, at: float) -> np.ndarray:
    """Return what one place of the guide does to one channel for a tenth of a pitch a loop, (n, c)."""
    place = np.arange(n) % FRAME.n_loop / FRAME.n_loop
    shape = np.exp(-0.5 * ((place - at) * FRAME.n_loop / (0.05 * FRAME.per_pitch)) ** 2)
    return SIZE * shape[:, None] * (np.arange(len(CHANNELS)) == TENSIONER) * spread()
