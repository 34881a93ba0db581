"""The contact law of eqs. (4) to (7) against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.law import (
    combined_curvature,
    friction_law,
    hertz_modulus,
    hysteresis,
    nominal_stiffness,
    normal_law,
    resistance_law,
)
from escalator_twin.physics.multibody.loop import relax
from escalator_twin.physics.multibody.network import make_memory, Network
from escalator_twin.physics.multibody.segments import Faces, Pen

pytestmark = pytest.mark.issue(8)

G = 9.81
MASS, RADIUS = 2.0, 0.05


def block(restitution=0.6, friction=0.3, normal_speed=0.01, sliding_speed=0.01, stiffness=1e8):
    """Return one body that cannot spin, above a level rail."""
    pen = Pen(-5.0, 0.0, 0.0)
    row = pen.line(20.0, Faces())
    row[[seg.STIFF_LOW, seg.STIFF_HIGH]] = stiffness
    row[seg.LOSS], row[seg.NORMAL_SPEED] = hysteresis(restitution), normal_speed
    row[seg.FRICTION], row[seg.SLIDING_SPEED] = friction, sliding_speed
    none = np.zeros((0, 2), np.int64)
    return Network(
        mass=np.array([MASS]), inertia=np.array([1e12]), link_ends=none, link=np.zeros((0, 6)),
        bush_ends=none, bush=np.zeros((0, 4)), point_body=np.array([0]),
        point_offset=np.zeros(1), point_rows=np.array([[0, 1]]), point_partner=np.array([-1]),
        drag=np.zeros((1, 8)), segments=np.array(pen.rows), part=np.zeros((0, 10)),
        rotor=np.zeros((0, 5)), load=np.zeros(1), load_point=np.array([-1]),
        load_stretch=np.zeros(3), stretch_drag=np.zeros((0, 5)), gravity=G,
    )  # fmt: skip


def run(network, z, vx=0.0, duration=1.0, h=1e-5, vz=0.0):
    """Return the body's coordinates, its velocity and the highest place after the first contact."""
    memory = make_memory(network)
    q, w = np.array([0.0, z, 0.0]), np.array([vx, vz, 0.0])
    highest, touched = -np.inf, False
    for _ in range(round(duration / (20 * h))):
        relax(network, memory, q, w, h, 20, 0.0)
        touched |= q[1] < 0.0
        if touched:
            highest = max(highest, q[1])
    return q, w, highest


def test_combined_curvature_takes_hollow_and_bulging_surfaces():
    assert combined_curvature(0.05) == pytest.approx(20.0)
    assert combined_curvature(0.05, 0.2) == pytest.approx(25.0)
    assert combined_curvature(0.05, -0.2) == pytest.approx(15.0)


def test_equation_5_is_hertz_for_two_like_metals_and_not_for_a_tread():
    steel, tread = (2.06e11, 0.3), (2.7e7, 0.48)
    assert hertz_modulus(steel, steel) == pytest.approx(2.06e11, rel=1e-3)
    assert tread[0] / hertz_modulus(tread) == pytest.approx(0.42, abs=0.01)
    # Hertz, two spheres: F = 4/3 E* sqrt(R) d^1.5
    effective = 0.5 * 2.06e11 / (1.0 - 0.3**2)
    law = nominal_stiffness(2.06e11, combined_curvature(0.02, 0.03))
    assert law == pytest.approx(4.0 / 3.0 * effective * np.sqrt(0.012), rel=1e-3)


@pytest.mark.parametrize('restitution', [0.3, 0.6, 0.9])
def test_a_fast_drop_rebounds_to_the_square_of_its_restitution(restitution):
    """2 m/s against a transition at 10 mm/s; weight works over the depth d, too.

    m g (h + d) = K (1 + b) d^2.5 / 2.5 in, of which C_r^2 comes out: m g (h' + d).
    """
    height = 0.2
    # the secant of the loss is of first order in the step
    _, _, highest = run(block(restitution), height, duration=0.4, h=2e-6)
    stiffness = 1e8 * (1.0 + hysteresis(restitution)) / 2.5
    depth = brentq(lambda d: stiffness * d**2.5 - MASS * G * (height + d), 0.0, 0.1)
    expected = restitution**2 * (height + depth) - depth
    assert highest == pytest.approx(expected, rel=0.01)


def test_a_slow_drop_rebounds_elastically():
    network = block(0.3, normal_speed=100.0)
    _, _, highest = run(network, 0.02, duration=0.14, h=4e-6)
    assert highest / 0.02 == pytest.approx(1.0, rel=0.03)


def test_work_over_a_cycle_is_the_restitutions():
    """At full speed both ways, a fraction C_r^2 of the work comes back."""
    for restitution in (0.2, 0.7):
        loss = hysteresis(restitution)
        depth = np.linspace(1e-6, 1e-3, 200)
        inwards = sum(normal_law(d, 5.0, 1e8, loss, 0.01)[0] for d in depth)
        outwards = sum(normal_law(d, -5.0, 1e8, loss, 0.01)[0] for d in depth)
        assert outwards / inwards == pytest.approx(restitution**2, rel=1e-9)


def test_no_depth_no_force_and_never_a_pull():
    assert normal_law(-1e-6, 1.0, 1e8, 0.9, 0.01) == (0.0, 0.0, 0.0)
    assert all(normal_law(1e-4, v, 1e8, hysteresis(0.0), 0.01)[0] >= 0.0 for v in (-9.0, 0.0, 9.0))


def test_a_block_at_rest_sinks_as_far_as_its_weight_asks():
    network = block()
    memory = make_memory(network)
    q, w = np.zeros(3), np.zeros(3)
    relax(network, memory, q, w, 1e-5, 40000, 200.0)
    assert -q[1] == pytest.approx((MASS * G / 1e8) ** (2.0 / 3.0), rel=1e-6)
    assert memory.normal[0] == pytest.approx(MASS * G, rel=1e-6)


@pytest.mark.parametrize(('speed', 'transition'), [(1.0, 0.01), (2.0, 0.5)])
def test_a_sliding_block_stops_where_friction_says(speed, transition):
    r"""v dv / dx = -mu g tanh(a v): x = (v^2 / 2 + pi^2 / 12 a^2) / mu g, a v >> 1."""
    network = block(friction=0.3, sliding_speed=transition)
    rest = -((MASS * G / 1e8) ** (2.0 / 3.0))
    q, w, _ = run(network, rest, vx=speed, duration=3.0, h=1e-4)
    a = 2.5 / transition
    expected = (speed**2 / 2.0 + np.pi**2 / (12.0 * a**2)) / (0.3 * G)
    assert q[0] == pytest.approx(expected, rel=2e-3)
    assert abs(w[0]) < 1e-3


def test_slopes_are_what_an_implicit_step_needs():
    """Of depth the derivative, of speeds the secant from rest: tanh has no slope where it is full."""
    small = 1e-9
    force, slope, damping = normal_law(1e-4, 0.003, 1e9, 0.5, 0.01)
    assert (normal_law(1e-4 + small, 0.003, 1e9, 0.5, 0.01)[0] - force) / small == pytest.approx(
        slope, rel=1e-4
    )
    still = normal_law(1e-4, 0.0, 1e9, 0.5, 0.01)[0]
    assert still + 0.003 * damping == pytest.approx(force)
    for speed in (1e-12, 0.002, 3.0):
        drag, steep = friction_law(speed, 50.0, 0.4, 0.01)
        assert speed * steep == pytest.approx(drag)
        law = (0.02, 0.5, 0.1, 0.3, 0.5, 0.01)
        drag, steep = resistance_law(speed, 500.0, law)
        assert speed * steep == pytest.approx(drag)


def test_friction_stops_a_light_body_and_does_not_drive_it():
    """A step of a full friction takes 0.05 m/s here, twenty times what the tangent sees of rest."""
    network = block(friction=50.0, sliding_speed=0.01)
    memory = make_memory(network)
    q, w = np.array([0.0, -((MASS * G / 1e8) ** (2.0 / 3.0)), 0.0]), np.array([0.11, 0.0, 0.0])
    speeds = []
    for _ in range(300):
        relax(network, memory, q, w, 1e-4, 1, 0.0)
        speeds.append(w[0])
    assert min(speeds) > -1e-12
    assert speeds[-1] < 1e-3


def test_a_rollers_drag_has_load_seals_speed_and_stribeck():
    law = (0.02, 1.5, 0.1, 3.0, 7.0, 1e-3)
    drag, _ = resistance_law(0.2, 500.0, law)
    assert drag == pytest.approx(0.02 * 500.0 * (1.0 + 1.5 * np.exp(-2.0)) + 3.0 + 7.0 * 0.2)
    assert resistance_law(-0.2, 500.0, law)[0] == -drag
    assert resistance_law(0.0, 500.0, law)[0] == 0.0
