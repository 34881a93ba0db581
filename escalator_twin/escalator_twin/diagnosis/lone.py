"""Whether what is left of a recording is one gauge's own."""

import numpy as np

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.unexplained import (
    by_channel,
    is_open,
    levels_of,
    limits_of,
    SIGMAS,
)
from escalator_twin.signals import Floats

IN_ONE = 0.9  # of the excess, from which it is taken to be in one gauge alone
LEAST_GAUGES = 3  # recorded, from which one that differs from all others says so


def is_in_one_gauge(place: Beside, floor: Floor) -> bool:
    """Tell whether what is above a good machine's is in one of several gauges alone.

    No part of the machine pulls at one link and at no other: it is the gauge's own, of whatever form. Tolerances that
    were fitted to that gauge spoil what all others say, so that they are fitted to the others as well.
    """
    sensors = place.stage.machine.instruments.sensors
    gauges = {s.channel for s in sensors if s.quantity == 'link_force'}
    own = np.array([channel in gauges for channel in place.stage.observation.channels])
    if own.sum() < LEAST_GAUGES or not is_open(place, floor):
        return False
    above = np.where(own, np.maximum(by_channel(place) - levels_of(place, floor), 0.0), -1.0)
    one = int(np.argmax(above))
    return _is_in(place, floor, by_channel(place), one) or _are_others_good(place, floor, one)


def _is_in(place: Beside, floor: Floor, chi2: Floats, one: int) -> bool:
    above = np.maximum(chi2 - levels_of(place, floor), 0.0)
    return bool(above[one] >= IN_ONE * above.sum())


def _are_others_good(place: Beside, floor: Floor, one: int) -> bool:
    """Tell whether all channels but one, all nuisance fitted to them alone, are as a good machine's."""
    fitted = place.fitted
    rows = len(place.stage.observation.channels)
    others = fitted.white.reshape(-1, rows).copy()
    others[:, one] = 0.0
    columns = fitted.columns.reshape(len(others), rows, -1).copy()
    columns[:, one] = 0.0
    sizes = fit(others.reshape(-1), columns.reshape(len(fitted.white), -1), fitted.offset).sizes
    left = fitted.white - fitted.columns @ sizes.astype(np.float32)
    chi2 = by_channel(place, left)
    beyond = chi2 > limits_of(place, floor, SIGMAS)
    beyond[one] = False
    return not beyond.any() and _is_in(place, floor, chi2, one)
