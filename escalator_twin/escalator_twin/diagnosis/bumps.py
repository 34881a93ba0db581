"""Run a bump of the rail at one place, and read what it would do at those beside it.

Rollers come to a bump that lies farther on so much later in travel, and else the same happens: only drive
and carriage are nearer or farther by that. So one run stands for all places about it: laid that much later,
what a bump does explains most of what one 0.1 m farther on does (measured in `docs/diagnosis_cases.md`),
where by its own place it is another wave within two centimetres.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import on_path
from escalator_twin.diagnosis.regression import score_each
from escalator_twin.diagnosis.search import Search, SIDES
from escalator_twin.diagnosis.whitening import in_travel
from escalator_twin.machine import Deviation
from escalator_twin.signals import Floats

FINE = 4  # places to a grid point: 1 to 3 mm
RAIL_M = 1.0  # no rail is laid in shorter pieces: at each end of one a good machine has a step of a tolerance
# Times the height that was run, for which what it does is taken in proportion: a roller leaves its track by
# a higher bump, and stays on it by a lower one.
ALIKE = (0.7, 1.4)


@dataclass(frozen=True)
class Bump:
    """What is run: a bump of some height and length, both m.

    ``is_low`` takes what it does in proportion for all lower heights, of either sign; ``is_free`` for all heights, which
    finds places where it hardly says how high a bump is.
    """

    height_m: float
    length_m: float
    is_low: bool = False
    is_free: bool = False

    def within(self, height: np.ndarray) -> np.ndarray:
        """Return heights as far as this one stands for them, m."""
        if self.is_free:
            return height
        low, high = sorted(share * self.height_m for share in ALIKE)
        if self.is_low:
            low, high = (way * max(abs(low), abs(high)) for way in (-1.0, 1.0))
        return np.clip(height, low, high)


@dataclass(frozen=True)
class Bumps:
    """Runs of bumps beside what a machine leaves.

    Attributes
    ----------
    search : Search
    waves : tuple of (f, c) complex128
        What a column explains is its product with the residual, weighed twice: the Fourier transform of that
        for the left, and for the right.
    size : int
        Samples that the transform is of.
    """

    search: Search
    waves: tuple[np.ndarray, np.ndarray]
    size: int

    @classmethod
    def beside(cls, search: Search, reach_m: float) -> 'Bumps':
        """Return the runs beside a search's residual; ``reach_m`` is how far one is read at most."""
        whiten, frame = search.whiten, search.view.observation.frame
        n, channels = search.model.shape
        weighed_once = whiten.weight * search.fitted.left().reshape(-1, channels)
        weighed = whiten.mask * in_travel(weighed_once, n)
        size = fft.next_fast_len(n + int(reach_m / frame.spacing_m) + 2, real=True)
        sides = weighed, mirrored(search, weighed)
        left, right = (fft.rfft(side, size, axis=0) for side in sides)
        return cls(search, (left, right), size)

    @property
    def length_m(self) -> float:
        """Of the loop."""
        return abs(self.search.view.responses.base.length_m)

    def at(self, place: float, bump: Bump, reach_m: float) -> list[Proposal]:
        """Propose a bump of one shape where it explains most: on the left, on the right and on both sides.

        Parameters
        ----------
        place : float
            Where it is run, m.
        bump : Bump
        reach_m : float
            To either side of the place.
        """
        search = self.search
        begin = on_path(place % self.length_m, search.stage.machine_length)
        location: dict[str, object] = {'s_m': begin, 'side': 'left'}
        shape: dict[str, object] = {'height_m': bump.height_m, 'length_m': bump.length_m}
        change = search.stage.run((Deviation('guide_step', shape, location),)) - search.model
        left = change / bump.height_m
        other = mirrored(search, left)
        score = score_each(
            search.fitted, search.whiten(np.stack([left, other, left + other], axis=2))
        )
        ways, products = self._beside(left, reach_m)
        found = []
        for k, side in enumerate((*SIDES, 'both')):
            power = 1.0 / score.sd[k] ** 2
            heights = bump.within(products[k] / power)
            gains = heights * (2.0 * products[k] - heights * power)
            best = int(np.argmax(gains))
            at = on_path((begin + ways[best]) % self.length_m, search.stage.machine_length)
            found.append(
                self._proposed(
                    at, side, float(heights[best]), bump.length_m, float(gains[best]),
                    float(score.sd[k]),
                )
            )  # fmt: skip
        return found

    def _beside(self, left: Floats, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return places beside the one of a run, m, and what it explains there on each side, (3, k)."""
        wave = np.conj(fft.rfft(left, self.size, axis=0))
        spectra = np.stack([(wave * own).sum(axis=1) for own in self.waves])
        fine = FINE * fft.irfft(spectra, FINE * self.size, axis=1)
        spacing = self.search.view.observation.frame.spacing_m / FINE
        lags = np.arange(-int(reach_m / spacing), int(reach_m / spacing) + 1)
        one, other = fine[:, lags]
        return self.search.view.direction * spacing * lags, np.stack([one, other, one + other])

    def _proposed(
        self, at: float, side: str, height: float, wide: float, gain: float, sd: float
    ) -> Proposal:
        count, joints = 3 * round(self.length_m / 0.25), 2 * round(self.length_m / RAIL_M)
        return Proposal(
            'guide_step', {'s_m': at, 'side': side}, {'height_m': height, 'length_m': wide},
            gain, {'height_m': sd}, count, ('height_m', '@s_m', 'length_m'), draws=joints,
        )  # fmt: skip


def mirrored(search: Search, columns: Floats) -> Floats:
    """Return a response on the channels of the other side, (n, c)."""
    sensors = [
        search.machine.instruments.sensor(channel) for channel in search.view.observation.channels
    ]
    other = np.array(columns)
    for k, sensor in enumerate(sensors):
        if sensor.at.get('axis') == 'y':
            other[:, k] = -columns[:, k]
        if 'side' not in sensor.at:
            continue
        twin = {**sensor.at, 'side': SIDES[1 - SIDES.index(str(sensor.at['side']))]}
        for j, candidate in enumerate(sensors):
            if candidate.quantity == sensor.quantity and candidate.at == twin:
                other[:, k] = columns[:, j]
    return other
