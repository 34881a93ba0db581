"""The second machine in motion: speeds, spectrum, tension and torque, cost, other sizes."""

from functools import cache
from itertools import pairwise
import time

import kwons
import numpy as np
import pytest

from escalator_twin.physics.multibody import loop
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.guide import chain_track, handrail_track
from escalator_twin.physics.multibody.layout import pose
from escalator_twin.physics.multibody.loop import relax
from escalator_twin.physics.multibody.network import make_memory
from escalator_twin.physics.multibody.segments import place_on
from escalator_twin.verification.rope import handrail_rope, step_rope, straight_places

pytestmark = pytest.mark.issue(8)

RATE_HZ = 200.0
PITCHES = 5
EVERY = 6  # link, body that is recorded
CLOSED_FORM = 0.03  # the bar on tension and torque


@cache
def running():
    """Return steps and handrail at steady speed: the record by name."""
    simulation = kwons.simulation()
    machine = simulation.machine
    simulation.start(3.0)
    n, layout = machine.chain.n_links, simulation.layout
    rail, bodies = layout.first_rail_link, machine.handrail.n_bodies
    first = layout.first_rail_point
    links, rails = range(0, n, EVERY), range(0, bodies, EVERY)
    groups = {
        'tension': [(loop.LINK_TENSION, i, 0) for i in links],
        'place': [(loop.POINT_PLACE, i, 0) for i in links],
        'rail': [(loop.LINK_TENSION, rail + i, 0) for i in rails],
        'rail_place': [(loop.POINT_PLACE, first + 2 * i, 0) for i in rails],
        'torque': [(loop.TORQUE, 0, 0)],
        'pulley': [(loop.TORQUE, 1, 0)],
        'acceleration': [(loop.ACCEL_X, n + 5, 0)],
    }
    duration = PITCHES * machine.chain.pitch_m / machine.experiment.speed_m_s
    probes = np.array([probe for group in groups.values() for probe in group])
    record = simulation.advance(duration, RATE_HZ, probes)
    ends = np.cumsum([len(group) for group in groups.values()])[:-1]
    return simulation, dict(zip(groups, np.split(record, ends, axis=1), strict=True))


def test_steps_and_handrail_run_at_their_speeds():
    simulation, found = running()
    machine, layout = simulation.machine, simulation.layout
    # of rollers that stay on the incline; over whole pitches the polygon comes back to itself
    track = layout.steps.chain
    row = track.rows[track.names.index('incline')]
    place = found['place'] - row[seg.START]
    on = ((place > 0.0) & (place < row[seg.LENGTH])).all(axis=0)
    way = place[:, on].mean(axis=1)
    span = (PITCHES - 1) * machine.chain.pitch_m / 0.5
    end = np.interp(span, np.arange(len(way)) / RATE_HZ, way)
    assert (end - way[0]) / span == pytest.approx(0.500, rel=5e-3)
    # on straight guides, where nothing bends it
    track = layout.handrail.track
    row = track.rows[track.names.index('incline')]
    place = found['rail_place'] - row[seg.START]
    inside = (place > 0.5) & (place < row[seg.LENGTH] - 0.5)
    both = inside[1:] & inside[:-1]
    rail = np.diff(found['rail_place'], axis=0)[both].mean() * RATE_HZ
    assert rail == pytest.approx(machine.handrail.speed_m_s, rel=5e-3)


def test_chain_tension_is_the_ropes_over_the_loop():
    simulation, found = running()
    machine = simulation.machine
    rope = step_rope(machine, machine.default_experiment())
    middle = (found['place'] + 0.5 * machine.chain.pitch_m) % simulation.path.length_m
    for _, begin, end in straight_places(machine):
        edges = np.linspace(begin, end, 5)
        for low, high in pairwise(edges):
            here = (middle > low) & (middle < high)
            mean = found['tension'][here].mean()
            assert mean == pytest.approx(rope.at(middle[here]).mean(), rel=CLOSED_FORM)
    assert found['torque'].mean() == pytest.approx(rope.torque_n_m, rel=CLOSED_FORM)


def test_handrail_tension_and_torque_are_the_ropes():
    simulation, found = running()
    rope = handrail_rope(simulation.machine, found['rail'].mean())
    track = simulation.layout.handrail.track
    half = 0.5 * simulation.layout.handrail.spacing_m
    place = (found['rail_place'] + 1.5 * half) % track.length_m
    for name in ('lower landing', 'incline', 'upper landing', 'return incline'):
        row = track.rows[track.names.index(name)]
        here = (place > row[seg.START] + half) & (place < row[seg.START] + row[seg.LENGTH] - half)
        expected = rope.at(place[here]).mean()
        assert found['rail'][here].mean() == pytest.approx(expected, rel=CLOSED_FORM)
    assert found['pulley'].mean() == pytest.approx(rope.torque_n_m, rel=CLOSED_FORM)


def test_forward_acceleration_has_the_lines_of_the_step_pitch():
    simulation, found = running()
    machine = simulation.machine
    signal = found['acceleration'][:, 0]
    n = len(signal)
    lines = np.abs(np.fft.rfft(signal - signal.mean())) * 2.0 / n
    pitch_hz = machine.experiment.speed_m_s / machine.chain.pitch_m
    published = (1.22, 2.44, 3.66)
    for k, hz in enumerate(published, start=1):
        assert k * pitch_hz == pytest.approx(hz, rel=0.01)
        # five pitches: line k is bin 5 k; beside it there is nothing of the kind
        between = max(lines[5 * k - 3], lines[5 * k + 2])
        assert lines[5 * k - 1 : 5 * k + 2].max() > 4.0 * between


def real_time_factor(simulation, sensors):
    """Return simulated over one core's own time, so that what else runs here does not count."""
    best = 0.0
    for _ in range(4):
        begun = time.thread_time()
        simulation.trace(0.5, RATE_HZ, sensors)
        best = max(best, 0.5 / (time.thread_time() - begun))
    return best


@pytest.mark.long
def test_the_whole_model_is_faster_than_real_time():
    simulation, _ = running()
    instruments = simulation.machine.instruments
    assert real_time_factor(simulation, instruments.sensors + instruments.simulated_only) > 1.0


@pytest.mark.long
def test_the_step_part_alone_is_five_times_as_fast():
    simulation = kwons.simulation(('steps',))
    simulation.rest(3.0)
    sensors = [s for s in simulation.machine.instruments.sensors if s.instrument != 'handrail']
    assert real_time_factor(simulation, tuple(sensors)) > 5.0


def test_a_start_from_rest_comes_to_speed_without_a_jerk():
    simulation = kwons.simulation(('steps',))
    simulation.rest(3.0)
    ramp = simulation.machine.drive.start_up_s
    probes = np.array([(loop.BODY_SPEED, 63, 0), (loop.LINK_MEAN, 0, 58)])
    record = simulation.advance(ramp + 1.0, RATE_HZ, probes, ramp)
    assert record[0, 0] < 0.01
    assert record[-100:, 0].mean() == pytest.approx(0.5, rel=0.03)
    assert record[:, 1].min() > 0.0


@pytest.mark.parametrize('name', ['kwon', 'kwon_30m', 'kwon_walk'])
def test_descriptions_close_their_loops_and_keep_their_runs_apart(name):
    machine = kwons.kwon(name)
    part = kwons.simulation(('steps',), name).layout.steps if name == 'kwon' else None
    for track in (chain_track(machine), handrail_track(machine, machine.handrail)):
        carrying = points(track, range(5))
        back = points(track, range(6, len(track.rows) - 1))
        gap = np.sqrt(((carrying[:, None] - back[None]) ** 2).sum(-1)).min()
        assert gap > 0.15
    if part is not None:
        assert part.n == 58


def points(track, rows):
    ways = np.concatenate([
        track.rows[k, seg.START] + np.linspace(0.0, 1.0, 60) * track.rows[k, seg.LENGTH]
        for k in rows
    ])  # fmt: skip
    return np.array([place_on(track.rows, track.length_m, s)[:2] for s in ways])


def body_cost(name):
    """Return a step's cost per body of the step part, by one core's own time, from its pose."""
    simulation = kwons.simulation(('steps',), name)
    memory, best = make_memory(simulation.network), np.inf
    q, memory.rotor[:, 0] = pose(simulation.layout, simulation.machine, 3.0)
    w = np.zeros(len(q))
    for _ in range(8):
        begun = time.thread_time()
        relax(simulation.network, memory, q, w, simulation.step_s, 200, 20.0)
        best = min(best, time.thread_time() - begun)
    return best / simulation.counts.bodies


@pytest.mark.long
def test_cost_per_body_does_not_grow_with_the_machine():
    small = body_cost('kwon')
    for name in ('kwon_30m', 'kwon_walk'):
        assert body_cost(name) == pytest.approx(small, rel=0.3)
