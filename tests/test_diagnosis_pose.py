"""An accelerometer that is turned by degrees leaves nothing, and is told to a hundredth of a degree."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
import trials

from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.nuisance import rotations, TURNED
from escalator_twin.diagnosis.observation import Observation

pytestmark = pytest.mark.issue(6)

MACHINE = trials.prototype()
SENSORS = MACHINE.instruments.sensors
CHANNELS = tuple(s.channel for s in SENSORS)
TRIAD = [CHANNELS.index(f'step/acceleration/{axis}') for axis in 'xyz']
FRAME = Frame.of(MACHINE, 0.5)
N = 2000
TOLERANCE_DEG = max(s.rotation_tol_deg for s in SENSORS)


def specific_force() -> np.ndarray:
    """Return what a step's frame feels that is tilted by up to 30 degrees and sways, (n, 3)."""
    tilt = np.deg2rad(30.0) * np.sin(np.linspace(0.0, 6.0, N)) ** 2
    sway = 0.05 * np.sin(np.linspace(0.0, 90.0, N))
    return np.column_stack([9.81 * np.sin(tilt), sway, 9.81 * np.cos(tilt)])


def fitted(read: np.ndarray, turned_deg: np.ndarray, names: list[str]) -> tuple[np.ndarray, float]:
    """Fit columns and zeros to what a sensor reads; return the columns' sizes and the largest rest."""
    force = specific_force()
    model = np.zeros((N, len(CHANNELS)))
    model[:, TRIAD] = force
    nothing = np.zeros_like(model)
    observation = Observation(
        FRAME, CHANNELS, np.arange(N), nothing, nothing, nothing == 0.0, 0.0,
        tuple(np.deg2rad(turned_deg)),
    )  # fmt: skip
    found = rotations(observation, model, MACHINE)
    columns = [found[name][:, TRIAD].astype(float).ravel() for name in names]
    zeros = [np.tile(row, N) for row in np.eye(3)]
    matrix = np.column_stack([*columns, *zeros])
    sizes, *_ = np.linalg.lstsq(matrix, (read - force).ravel(), rcond=None)
    rest = (read - force).ravel() - matrix @ sizes
    return sizes[: len(names)], float(np.abs(rest).max())


FIRST = ['rotation/x', 'rotation/y', 'rotation/z']


@pytest.mark.parametrize('angles', [(-2.96, 1.13, 2.44), (2.5, -3.1, 0.5), (0.0, -4.0, 0.0)])
def test_a_turned_sensor_is_told_beyond_the_first_order(angles):
    turned = np.array(angles)
    read = Rotation.from_rotvec(turned, degrees=True).inv().apply(specific_force())
    _, left_plain = fitted(read, turned, FIRST)
    sizes, left = fitted(read, turned, [*FIRST, TURNED])
    assert sizes[:3] * TOLERANCE_DEG == pytest.approx(turned, abs=0.01)
    assert sizes[3] == pytest.approx(1.0, abs=0.01)
    assert left < 1e-3 < left_plain


def test_a_sensor_that_reads_to_first_order_is_told_as_well():
    turned = np.array([-2.96, 1.13, 2.44])
    force = specific_force()
    read = force - np.cross(np.deg2rad(turned), force)
    sizes, left = fitted(read, turned, [*FIRST, TURNED])
    assert sizes[:3] * TOLERANCE_DEG == pytest.approx(turned, abs=0.01)
    assert sizes[3] == pytest.approx(0.0, abs=0.01)
    assert left < 1e-3


def test_in_a_good_sensor_there_is_nothing_beyond_the_first_order():
    force = specific_force()
    turned = np.array([0.3, -0.3, 0.3])
    read = Rotation.from_rotvec(turned, degrees=True).inv().apply(force)
    _, left = fitted(read, turned, FIRST)
    assert left < 1e-3
