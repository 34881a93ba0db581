"""The twin's own error: what remains between it and a good machine beyond the sensors' noise.

The table is measured, not derived: recordings of machines within tolerance are fitted with all
nuisance, and what remains is averaged by speed, channel and frequency. Two parts: a smooth one, as
a multiple of the sensor's noise by order (cycles per pitch of travel), and lines at the multiples
of the pitch, where waves of the rail that the survey does not show move all rollers alike.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy import stats

from escalator_twin.machine import Sensor
from escalator_twin.signals import Floats

SCHEMA = 'escalator_twin/floor/1'
ORDERS = (0.0, 0.1, 0.5, 1.5, 3.5, 6.5, 10.0, 16.0, 40.0)  # edges of the smooth part
HARMONICS = 32
CELLS = 49  # of the loop, about 0.5 m each: where in it a channel's own error is large
# The twin's error is not noise of its own in every sample: in machines within tolerance the falls of
# chi squared that false causes reach exceed those of white noise by a factor. This is that of linked
# chains (calibrated on generated recordings, docs/diagnosis_constants.md); a floor's file may tell another.
TEMPERATURE = 8.0
LINE_HALF = 0.03  # orders that belong to a line on each side
LINE_SCALE = 0.013  # a line's skirt falls by e over this order: the place in the loop modulates it
LINE_REACH = 0.1
# Of recordings of machines within tolerance, where a floor's file does not tell: mean of the logarithm
# of chi squared per coefficient over the floor, and its standard deviation.
CLEAN_LOG, CLEAN_SD = -0.15, 0.22
# Rollers rattle in their clearance. Any change of the model, however small, rolls these dice anew, so
# that two runs differ by more than either from the machine, in bursts, where the force on a roller
# changes sign: there these channels' weight is taken down.
RATTLING = frozenset({'step_acceleration/z', 'step_acceleration/x'})
# Causes that act on a step's x and z directly. What any other cause or tolerance seems to change there
# is chance: taken at one standard deviation up and down, responses correlate by -0.7 to 0 instead
# of 0.8 to 1 as those of forces, tensioner and y do. As columns of a fit such chance shrinks every
# size, of a tread that is not round and of a wave of the drive too: most of what they do is in forces.
SHAKING = frozenset({'guide_step', 'truss_resonance'})
PASSED = frozenset({'guide_step'})  # of these, what every step feels where it passes a place


def kind_of(sensor: Sensor) -> str:
    """Return the name under which channels of one kind share a floor."""
    axis = sensor.at.get('axis')
    return f'{sensor.quantity}/{axis}' if axis else sensor.quantity


def is_shaken(sensor: Sensor) -> bool:
    """Tell whether rattling rollers shake what a sensor reads."""
    return kind_of(sensor) in RATTLING


@dataclass(frozen=True)
class Level:
    """The floor of one kind of channel at one speed.

    Attributes
    ----------
    smooth : (len(ORDERS) - 1,) float64
        Variance over the sensor's.
    lines : (h,) float64
        Mean square at each multiple of the pitch, SI squared.
    mean : (float, float), optional
        What the mean of a good machine's channel is above the twin's, and its scatter, SI; None
        where the mean is a zero of the instrument.
    spread : (CELLS,) float64, optional
        Standard deviation by place of the step in the loop, in units of which the rest is measured;
        None where it is everywhere the same.
    """

    smooth: Floats
    lines: Floats
    mean: tuple[float, float] | None = None
    spread: Floats | None = None


@dataclass(frozen=True)
class Clean:
    """What good recordings of one maker look like beside the floor.

    Attributes
    ----------
    source : str
    recordings : int
    kinds : mapping of kind to (float, float)
        Mean and standard deviation of the logarithm of chi squared per coefficient.
    """

    source: str
    recordings: int
    kinds: Mapping[str, tuple[float, float]]

    def limit(self, kind: str, sigmas: float) -> float:
        """Return what one more recording passes as seldom as a normal number passes ``sigmas``.

        Mean and scatter are known from a few: what a next one is away from their mean, in their
        own scatter, is distributed as Student's t with n - 1 degrees of freedom,
        sqrt(1 + 1/n) as wide.
        """
        level, scatter = self.kinds[kind]
        n = self.recordings
        quantile = stats.t.isf(stats.norm.sf(sigmas), n - 1) * np.sqrt(1.0 + 1.0 / n)
        return float(level + quantile * scatter)


@dataclass(frozen=True)
class Floor:
    """Levels by kind of channel and speed, m/s.

    Attributes
    ----------
    levels : mapping of kind to mapping of speed to Level
    clean : (float, float), optional
        Mean and standard deviation, over channels and good machines, of the logarithm of chi
        squared per coefficient over the floor.
    groups : tuple of Clean
        The same by kind of channel, for each maker whose good recordings were seen; the first is the one
        that the floor itself was measured on.
    borrowed : str
        The machine that it was measured on, where that is another one.
    """

    levels: Mapping[str, Mapping[float, Level]]
    clean: tuple[float, float] | None = None
    temperature: float = TEMPERATURE
    leans: Mapping[str, float] = field(default_factory=dict)
    groups: tuple[Clean, ...] = ()
    borrowed: str = ''

    def limit(self, kind: str, sigmas: float) -> float:
        """Return the logarithm of chi squared that a good machine of any known maker seldom passes.

        Parameters
        ----------
        kind : str
        sigmas : float
            As seldom as a normal number passes so many.
        """
        limits = [group.limit(kind, sigmas) for group in self.groups if kind in group.kinds]
        level, scatter = self.clean or (CLEAN_LOG, CLEAN_SD)
        return max(limits, default=level + sigmas * scatter)

    def level_of(self, kind: str) -> float:
        """Return the mean logarithm of chi squared of good machines' channels of a kind."""
        known = [group.kinds[kind][0] for group in self.groups[:1] if kind in group.kinds]
        return known[0] if known else (self.clean or (CLEAN_LOG, CLEAN_SD))[0]

    def mean_of(self, sensor: Sensor, speed_m_s: float) -> tuple[float, float] | None:
        """Return what a channel's mean is above the twin's, and its scatter, SI; None unknown."""
        levels = self.levels.get(kind_of(sensor))
        if not levels:
            return None
        return levels[min(levels, key=lambda s: abs(np.log(s / speed_m_s)))].mean

    def spread(self, sensor: Sensor, share: Floats, speed_m_s: float) -> Floats:
        """Return by how much a channel's own error is larger at some places than elsewhere.

        Parameters
        ----------
        sensor : Sensor
        share : (n,) float64
            Path coordinate of what the sensor sits on, of the loop, 0 to 1.
        speed_m_s : float
        """
        levels = self.levels.get(kind_of(sensor))
        level = _between(levels, speed_m_s) if levels else None
        if level is None or level.spread is None:
            return np.ones(len(share))
        return np.asarray(level.spread[cell_of(share)])

    def variance(
        self, sensor: Sensor, sensor_variance: float, orders: Floats, speed_m_s: float, n: int
    ) -> Floats:
        """Return the variance of cosine coefficients at some orders.

        Parameters
        ----------
        sensor : Sensor
        sensor_variance : float
            Of a coefficient, by the sensor's noise alone.
        orders : (f,) float64
            Cycles per pitch.
        speed_m_s : float
        n : int
            Samples that the transform is taken of.
        """
        levels = self.levels.get(kind_of(sensor))
        if not levels:
            return np.full(len(orders), sensor_variance)
        level = _between(levels, speed_m_s)
        bins = np.clip(np.searchsorted(ORDERS, orders, side='right') - 1, 0, len(ORDERS) - 2)
        variance = sensor_variance * np.maximum(level.smooth[bins], 1.0)
        spacing = orders[1] - orders[0]
        skirt = 2.0 * LINE_SCALE / spacing  # coefficients over which a line is spread
        for h, power in enumerate(level.lines, 1):
            away = np.abs(orders - h)
            near = away < LINE_REACH
            # a wave of mean square P puts n P into the coefficients around its order
            variance[near] += n * power / skirt * np.exp(-away[near] / LINE_SCALE)
        return np.asarray(variance)


def _between(levels: Mapping[float, Level], speed_m_s: float) -> Level:
    """Interpolate levels over the logarithm of speed; the nearest outside."""
    speeds = sorted(levels)
    at = np.log(np.clip(speed_m_s, speeds[0], speeds[-1]))

    def mix(rows: Sequence[Floats]) -> Floats:
        table = np.log(np.maximum(np.stack(rows), 1e-30))
        return np.exp([np.interp(at, np.log(speeds), column) for column in table.T])

    spreads = [found for s in speeds if (found := levels[s].spread) is not None]
    return Level(
        mix([levels[s].smooth for s in speeds]),
        mix([levels[s].lines for s in speeds]),
        spread=mix(spreads) if len(spreads) == len(speeds) else None,
    )


def cell_of(share: Floats) -> np.ndarray:
    """Return the cell of the loop at some shares of it, (n,) int."""
    return np.clip((share * CELLS).astype(int), 0, CELLS - 1)


def measure_level(white: Floats, orders: Floats, sensor_variance: float, n: int) -> Level:
    """Measure one channel's floor in one recording.

    Parameters
    ----------
    white : (f,) float64
        Coefficients over the sensor's standard deviation, all nuisance taken out.
    orders : (f,) float64
    sensor_variance : float
    n : int
    """
    power = white**2
    away = np.abs(orders - np.round(orders))
    smooth = np.ones(len(ORDERS) - 1)
    for k, (low, high) in enumerate(pairwise(ORDERS)):
        mask = (orders >= low) & (orders < high) & ((away > 2.0 * LINE_HALF) | (orders < 0.5))
        mask[0] = False
        if mask.sum() > 3:
            smooth[k] = float(np.mean(power[mask]))
    lines = np.zeros(HARMONICS)
    for h in range(1, HARMONICS + 1):
        mask = np.abs(orders - h) < LINE_HALF
        rest = smooth[min(int(np.searchsorted(ORDERS, h, side='right')) - 1, len(smooth) - 1)]
        excess = float(np.sum(power[mask] - rest)) if mask.any() else 0.0
        lines[h - 1] = max(excess, 0.0) * sensor_variance / n
    return Level(smooth, lines)


def mean_level(levels: Sequence[Level]) -> Level:
    """Average the floors of several recordings."""
    return Level(
        np.mean([level.smooth for level in levels], axis=0),
        np.mean([level.lines for level in levels], axis=0),
    )
