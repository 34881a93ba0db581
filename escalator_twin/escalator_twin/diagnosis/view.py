"""How a cause at any place looks in an observation: columns out of one-loop responses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from escalator_twin.diagnosis.loops import sensor_probes
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.responses import at_sensors, Responses
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats

NO_PROBES = np.zeros((0, 3), np.int64)  # enough for places


@dataclass(frozen=True)
class View:
    """Looks up loop responses where an observation's samples were taken.

    Attributes
    ----------
    observation : Observation
    responses : Responses
    direction : int
        +1 up, -1 down.
    probes : (c, 3) int64
        Of the observation's channels.
    """

    observation: Observation
    responses: Responses
    direction: int
    probes: np.ndarray

    @classmethod
    def of(
        cls, machine: Machine, observation: Observation, responses: Responses, direction: int
    ) -> 'View':
        """Return the view of a machine's observation."""
        sensors = {s.channel: s for s in machine.instruments.sensors}
        probes = sensor_probes(
            tuple(sensors[c] for c in observation.channels), machine.chain.n_links
        )
        return cls(observation, responses, direction, probes)

    @property
    def n_links(self) -> int:
        """Links of a side."""
        return self.observation.frame.n_links

    def unwrapped(self, index: int) -> np.ndarray:
        """Return the grid points at which part 0 would be where part ``index`` is, (n,)."""
        frame = self.observation.frame
        return self.observation.index + self.direction * index * frame.per_pitch

    def at(self, columns: np.ndarray, index: int = 0, mirrored: bool = False) -> np.ndarray:
        """Return a response (n_loop, 1 + 5 n), taken at index 0, as seen at ``index``: (n, c)."""
        picked = at_sensors(columns, self.probes, self.n_links, index, mirrored)
        return picked[self.unwrapped(index) % self.observation.frame.n_loop]

    def each(self, columns: np.ndarray, sides: Sequence[bool] = (False,)) -> np.ndarray:
        """Return a response at every index, for every side: (n, c, sides n_links)."""
        views = [self.at(columns, i, side) for side in sides for i in range(self.n_links)]
        return np.stack(views, axis=2)

    def turning(
        self, waves: np.ndarray, rolled_m: Floats, index: int, mirrored: bool
    ) -> np.ndarray:
        """Return a complex response to a tread's wave of one order per turn: (n, c).

        ``rolled_m`` (n_loop + 1,) is the way that axle 0 rolled in the run behind ``waves``.
        """
        picked = at_sensors(waves, self.probes, self.n_links, index, mirrored)
        return self.rolling(picked, rolled_m, index)

    def rolling(
        self, picked: np.ndarray, rolled_m: Floats, index: int, order: int = 1
    ) -> np.ndarray:
        """Return the same of what the sensors see already, (n_loop, c), of any order per turn."""
        frame = self.observation.frame
        where = self.unwrapped(index)
        loops = where // frame.n_loop
        per_loop = (rolled_m[-1] - rolled_m[0]) / self.responses.radius_m
        turn = np.exp(1j * order * per_loop * loops).astype(np.complex64)
        seen: np.ndarray = picked[where % frame.n_loop] * turn[:, None]
        return seen

    def place_of(self, index: int) -> Floats:
        """Return the path coordinate of axle ``index`` at the grid points, m, (n,)."""
        length = abs(self.responses.base.length_m)
        place = self.responses.base.place_m[self.unwrapped(index) % self.observation.frame.n_loop]
        found: Floats = place % length
        return found

    def turn_at_start(self, rolled_m: Floats, index: int, at_start_m: float) -> float:
        """Return the angle by which a tread's phase in a loop is behind that in the run, rad.

        Parameters
        ----------
        rolled_m : (n_loop + 1,) float64
            Way that axle 0 rolled in the loop.
        index : int
            Of the axle.
        at_start_m : float
            Way that it has rolled at the first sample of a run beside the recording, see
            `Stage.rolled_at_start`.
        """
        frame, n = self.observation.frame, len(rolled_m) - 1
        where = (
            self.observation.start_m / frame.spacing_m + self.direction * index * frame.per_pitch
        )
        loops = np.floor(where / n)
        rolled = np.interp(where - loops * n, np.arange(n + 1), rolled_m)
        rolled += loops * (rolled_m[-1] - rolled_m[0])
        return float((rolled - at_start_m) / self.responses.radius_m)
