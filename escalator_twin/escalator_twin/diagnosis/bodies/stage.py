"""One recording beside a machine of free bodies."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.bodies.running import Runs
from escalator_twin.diagnosis.knobs import turn_all
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.machine import Deviation
from escalator_twin.physics.course import course_of
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Floats

# Where causes of a chain's both sides sit: a planar machine has no sides.
SIDED: dict[str, dict[str, object]] = {'chain_elongation': {'side': 'both'}}


@dataclass(frozen=True, kw_only=True)
class BodyStage(Stage):
    """A stage whose machine runs part by part, and where some means are no zeros.

    Attributes
    ----------
    runs : Runs
    above : mapping of channel to float
        What the means that count are above the twin's in good machines, SI.
    leans : mapping of nuisance to (cause, float)
        What the twin's own error is like, and one standard deviation of the cause's size.
    """

    runs: Runs
    above: Mapping[str, float]
    leans: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    @property
    def quiet(self) -> np.ndarray:
        """Every channel: no roller rattles here whose dice a change would roll."""
        return np.ones(len(self.observation.channels), bool)

    @property
    def machine_length(self) -> float:
        """Length of the path of axle 0, m."""
        return course_of(self.machine).length_m

    def trace(self, deviations: tuple[Deviation, ...] = (), without: str | None = None) -> Trace:
        """Simulate the machine with more deviations."""
        sizes = {k: v for k, v in self.turned.items() if k != without and v != 0.0}
        if not sizes:
            return self.runs.trace(apply(self.machine, deviations))
        leaning = tuple(
            self._leaning(name, sizes.pop(name)) for name in self.leans if name in sizes
        )
        machine, experiment = turn_all(self.machine, self.setting.experiment, self.knobs, sizes)
        return Runs(self.setting).trace(apply(machine, (*leaning, *deviations)), experiment)

    def _leaning(self, name: str, size: float) -> Deviation:
        """Return what a nuisance that the twin's own error is like does, in standard deviations."""
        cause, sd = self.leans[name]
        (parameter,) = KNOWN[cause].sizes
        value = (parameter.neutral or 0.0) + size * sd
        return Deviation(cause, {parameter.name: value}, SIDED.get(cause, {}))

    @property
    def limited(self) -> frozenset[str]:
        """Nuisance that a good machine has no more than ``LARGEST`` of."""
        return frozenset({knob.name for knob in self.knobs} | set(self.leans))

    def allowed(self, sizes: Floats) -> Floats:
        """Return sizes of the nuisance no larger than a good machine may have them.

        A zero stretched beyond would explain what an effect does to a mean.
        """
        bound = {f'{channel}/zero' for channel in self.above} | self.limited
        limits = np.array([LARGEST if name in bound else np.inf for name in self.nuisance.names])
        return np.clip(sizes, -limits, limits)

    @property
    def told_by_mean(self) -> frozenset[str]:
        """Channels whose mean counts."""
        return frozenset(self.above)

    def residual(self, model: Floats) -> Floats:
        """Return measured less simulated, (n, c); what counts of a mean stays in it."""
        centred = super().residual(model)
        valid = self.observation.valid
        for k, channel in enumerate(self.observation.channels):
            if channel in self.above and valid[:, k].any():
                difference = (self.observation.measured - model)[:, k]
                centred[:, k] = difference - self.above[channel]
        return centred
