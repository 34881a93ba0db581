"""The second machine's model: counts of the paper, guides that close, and every contact pair."""

import kwons
import numpy as np
import pytest

from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.contacts import contacts, search
from escalator_twin.physics.multibody.guide import (
    chain_track,
    HANDRAIL_SEGMENTS,
    handrail_track,
    STEP_SEGMENTS,
    trailing_track,
)
from escalator_twin.physics.multibody.layout import pose
from escalator_twin.physics.multibody.network import make_memory
from escalator_twin.physics.multibody.segments import place_on

pytestmark = pytest.mark.issue(8)

# Kwon, Park and Park, sections 3.1 and 3.2
STEPS = {'bodies': 58 + 116, 'degrees_of_freedom': 523, 'spring_dampers': 174,
         'contact_pairs': 1044}  # fmt: skip
HANDRAIL = {'bodies': 127, 'degrees_of_freedom': 381, 'spring_dampers': 127,
            'contact_pairs': 3048}  # fmt: skip
PARTS = {
    ('steps',): STEPS,
    ('handrail',): HANDRAIL,
    ('steps', 'handrail'): {key: STEPS[key] + HANDRAIL[key] for key in STEPS},
}
INSIDE, DEEP = 0.37, 2e-3  # of a segment's length; m beyond a face


@pytest.mark.parametrize('parts', PARTS, ids='+'.join)
def test_the_built_model_has_the_papers_counts(parts):
    simulation = kwons.simulation(parts)
    for key, value in PARTS[parts].items():
        assert getattr(simulation.counts, key) == value
    assert str(PARTS[parts]['contact_pairs']) in simulation.counts.line()
    # MuJoCo's own: three joints a body, the lower gear's, and the driven ones
    driven = len(parts)
    assert simulation.model.nv == PARTS[parts]['degrees_of_freedom'] + driven


def test_each_roller_has_nine_segments_and_each_rail_point_twelve():
    network = kwons.simulation().network
    pairs = network.point_rows[:, 1] - network.point_rows[:, 0]
    assert list(pairs) == [9] * 116 + [12] * 254
    assert (len(STEP_SEGMENTS), len(HANDRAIL_SEGMENTS)) == (9, 12)


@pytest.mark.parametrize('which', ['chain', 'trailing', 'handrail'])
def test_guides_close_and_bend_smoothly(which):
    machine = kwons.kwon()
    track = {
        'chain': lambda: chain_track(machine),
        'trailing': lambda: trailing_track(machine),
        'handrail': lambda: handrail_track(machine, machine.handrail),
    }[which]()
    for s in [*track.rows[:, seg.START], track.length_m]:
        before = np.array(place_on(track.rows, track.length_m, s - 1e-9))
        after = np.array(place_on(track.rows, track.length_m, s + 1e-9))
        assert np.abs(before - after).max() < 1e-7


def test_treads_stay_level_on_the_passenger_run():
    machine = kwons.kwon()
    chain, trailing = chain_track(machine), trailing_track(machine)
    for s in np.linspace(machine.step.wheelbase_m + 0.01, chain.passenger_m - 0.01, 40):
        x, z, _, _ = place_on(chain.rows, chain.length_m, s)
        ahead = s - machine.step.wheelbase_m  # both rails begin where the lower gear ends
        behind = place_on(trailing.rows, trailing.length_m, ahead)
        assert behind[:2] == pytest.approx((x - machine.step.wheelbase_m, z), abs=1e-9)


def test_every_pair_pushes_a_body_that_is_driven_into_it():
    """All 1044 and 3048 pairs, lower faces and, where there are any, upper ones."""
    simulation = kwons.simulation()
    network, memory = simulation.network, make_memory(simulation.network)
    q, _ = pose(simulation.layout, simulation.machine, 3.0)
    rest, w = q.copy(), np.zeros(len(q))
    points = network.point_body, network.point_offset, network.point_rows
    sizes = len(network.mass), network.part
    pushed = 0
    for c in range(len(network.point_body)):
        body = 3 * network.point_body[c]
        for k in range(*network.point_rows[c]):
            row = network.segments[k]
            faces = [1.0] if np.isinf(row[seg.WIDTH]) else [1.0, -1.0]
            for side in faces:
                q[:] = rest
                x, z, tx, tz = place_of(row, INSIDE * row[seg.LENGTH])
                low = row[seg.LOW] + INSIDE * (row[seg.LOW_END] - row[seg.LOW])
                e = low - DEEP if side > 0 else low + row[seg.WIDTH] + DEEP
                offset = network.point_offset[c]
                q[body + 2] = np.arctan2(tz, tx)
                q[body] = x - e * tz - offset * tx
                q[body + 1] = z + e * tx - offset * tz
                near = memory.near[c : c + 1]
                one = tuple(a[c : c + 1] for a in points)
                search(q, network.segments, sizes[1], 3 * sizes[0], one, near)
                memory.near[:c], memory.near[c + 1 :] = -1, -1
                memory.force[:] = 0.0
                contacts(network, memory, q, w, 1e-4)
                assert memory.touching[c] == k
                assert memory.normal[c] * side > 1.0
                across = memory.force[network.point_body[c], 0] * -tz
                across += memory.force[network.point_body[c], 1] * tx
                assert across * side > 1.0
            pushed += 1
    assert pushed == 1044 + 3048


def place_of(row, s):
    """Return point and tangent on one segment."""
    alone = row.copy()
    alone[seg.START] = 0.0
    return place_on(alone[None], row[seg.LENGTH], s)


def test_a_seat_of_the_upper_gear_carries_a_roller_along():
    simulation = kwons.simulation(('steps',))
    network, memory = simulation.network, make_memory(simulation.network)
    q, angles = pose(simulation.layout, simulation.machine, 3.0)
    memory.rotor[:, 0] = angles + 0.002  # the gear a little ahead of its rollers
    points = network.point_body, network.point_offset, network.point_rows
    search(q, network.segments, network.part, 3 * len(network.mass), points, memory.near)
    contacts(network, memory, q, np.zeros(len(q)), 1e-4)
    assert memory.torque[0] > 1.0
