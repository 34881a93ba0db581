"""Causes in machines of free bodies: neutral ones change nothing, others what their law says."""

from dataclasses import replace
from functools import cache

import kwons
import numpy as np
import pytest

from escalator_twin.causes import alter_layout, alter_machine, apply, KNOWN
from escalator_twin.errors import MachineError
from escalator_twin.machine import Deviation, load_machine
from escalator_twin.physics.multibody import loop
from escalator_twin.physics.multibody.layout import lay_out, slack_m
from escalator_twin.physics.multibody.segments import LENGTH, START
from escalator_twin.physics.multibody.simulation import MultibodySimulation

pytestmark = pytest.mark.issue(8)

# named by the issue, each with a place on this machine
MACHINE = {
    'rolling_resistance': {},
    'roller_drag': {'axle': 7, 'side': 'left'},
    'chain_elongation': {'side': 'both'},
    'tensioner_preload': {},
    'tensioner_friction': {},
    'gear_eccentricity': {'which': 'upper'},
    'handrail_drag': {},
}
MORE = {'tensioner_stiffness': {}, 'link_elongation': {'link': 3}, 'friction_speed': {}}
MEASUREMENT = {
    'gauge_gain': {'link': 'tension'},
    'gauge_drift': {'link': 'tension'},
    'gauge_dead': {'link': 'tension', 'gauge': 2},
    'accelerometer_misalignment': {},
    'axis_inverted': {'axis': 'x'},
}
SOME = kwons.kwon()
RATE_HZ = 200.0


def deviated(name, **parameters):
    place = (MACHINE | MORE | MEASUREMENT)[name]
    return apply(SOME, (Deviation(name, parameters, place),))


def layout_of(machine, parts=('steps',)):
    altered = alter_machine(machine)
    return alter_layout(lay_out(altered, SOME.default_experiment(), parts), altered)


@cache
def plain(parts):
    return lay_out(SOME, SOME.default_experiment(), parts)


def parts_of(name):
    return ('handrail',) if name == 'handrail_drag' else ('steps',)


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize('name', MACHINE | MORE)
def test_a_cause_changes_numbers_and_its_neutral_size_does_not(name):
    cause, parts = KNOWN[name], parts_of(name)
    before = plain(parts).network
    kept = [np.array(v, copy=True) for v in before]
    neutral = layout_of(deviated(name, **cause.neutral()), parts).network
    if name != 'handrail_drag':  # a stretch without force is still a row
        assert same(neutral, before)
    for reference in cause.references:
        assert not same(layout_of(deviated(name, **reference), parts).network, before)
    assert same(before, kept)


@pytest.mark.parametrize('name', MEASUREMENT)
def test_faults_of_the_instruments_find_their_sensors(name):
    cause = KNOWN[name]
    reference = cause.references[0] if cause.references else {}
    assert deviated(name, **reference).deviations[-1].cause == name


@pytest.mark.parametrize('name', ['truss_resonance', 'load_offset', 'guide_step'])
def test_what_needs_two_sides_or_another_guide_is_refused(name):
    with pytest.raises(MachineError, match=r'expected one of a machine of planar_multibody'):
        apply(SOME, (Deviation(name, {}, {}),))


@pytest.mark.parametrize('name', ['gear_eccentricity', 'handrail_drag'])
def test_causes_of_free_bodies_are_refused_elsewhere(name):
    prototype = load_machine(kwons.MACHINES / 'prototype.yaml')
    with pytest.raises(MachineError, match=r'expected one of a machine of linked_chain'):
        apply(prototype, (Deviation(name, {}, {}),))


def test_a_worn_chain_is_as_much_longer_as_its_links():
    longer = layout_of(deviated('chain_elongation', length_m=1e-4))
    # 58 links, straight between rollers: a link in a bend takes up a little more than its length
    worn = replace(longer.steps, network=longer.network)
    more = slack_m(worn) - slack_m(plain(('steps',)).steps)
    assert more == pytest.approx(58e-4, rel=0.15)
    one_side = Deviation('chain_elongation', {'length_m': 1e-4}, {'side': 'left'})
    half = layout_of(apply(SOME, (one_side,))).network.link[:, 2]
    assert half == pytest.approx(SOME.chain.pitch_m + 0.5e-4)


def run(layout, probes, duration=1.6256, ramp=0.6, settle=0.8, machine=SOME):
    simulation = MultibodySimulation(machine, layout)
    simulation.rest(3.0)
    simulation.advance(ramp + settle, RATE_HZ, np.zeros((0, 3), np.int64), ramp)
    return simulation.advance(duration, RATE_HZ, np.array(probes))


def test_a_dragging_roller_takes_its_force_from_the_chain():
    probes = [(loop.LINK_TENSION, 6, 0), (loop.LINK_TENSION, 7, 0)]
    before = run(plain(('steps',)), probes).mean(axis=0)
    dragging = layout_of(deviated('roller_drag', force_N=120.0))
    after = run(dragging, probes).mean(axis=0)
    # its axle is on the incline: tension steps by the force across it
    step = (after[1] - after[0]) - (before[1] - before[0])
    assert step == pytest.approx(120.0, rel=0.05)


def test_a_roller_that_drags_on_the_lower_gear_pulls_at_its_carriage_too():
    """What it runs on is carried by the carriage: both strands together stay what they were."""
    probes = [(loop.LINK_TENSION, i, 0) for i in range(58)]
    probes += [(loop.POINT_PLACE, i, 0) for i in range(58)]
    track = plain(('steps',)).steps.chain
    start, end = (track.rows[8, column] for column in (START, LENGTH))

    def strands(layout):
        record = run(layout, probes)
        tension, place = record[:, :58], record[:, 58:]
        here = (place[:, 47] - start) % track.length_m < end
        low = (place - start + 0.9) % track.length_m < 0.45  # links before the gear, by hind ends
        high = (place - start - end) % track.length_m < 0.45  # behind it
        return [np.where(rows, tension, np.nan)[here] for rows in (low, high)]

    before = [np.nanmean(v) for v in strands(plain(('steps',)))]
    place = {'axle': 47, 'side': 'both'}
    dragging = apply(SOME, (Deviation('roller_drag', {'force_N': 120.0}, place),))
    after = [np.nanmean(v) for v in strands(layout_of(dragging))]
    gained = np.array(after) - np.array(before)
    assert gained[1] - gained[0] == pytest.approx(120.0, rel=0.1)
    assert gained.sum() == pytest.approx(0.0, abs=12.0)


def test_a_dragging_handrail_asks_its_pulley_for_the_force():
    probes = [(loop.TORQUE, 0, 0)]
    before = run(plain(('handrail',)), probes).mean()
    after = run(layout_of(deviated('handrail_drag', force_N=150.0), ('handrail',)), probes).mean()
    arm = SOME.handrail.pulley_radius_m
    # more pull in the bends makes them drag more, too
    assert 150.0 * arm < after - before < 1.25 * 150.0 * arm


def test_an_eccentric_gear_shakes_the_chain_once_per_turn():
    turn_s = 2.0 * np.pi / plain(('steps',)).network.rotor[0, 0]
    probes = [(loop.POINT_PLACE, 5, 0)]
    n = round(turn_s * RATE_HZ)

    def wave(layout):
        place = np.unwrap(run(layout, probes, turn_s)[:, 0], period=layout.steps.chain.length_m)
        place = place - np.linspace(0.0, 1.0, len(place)) * (place[-1] - place[0])
        return 2.0 * np.abs(np.fft.rfft(place)[1]) / n

    eccentric = layout_of(deviated('gear_eccentricity', amplitude_m=2e-3))
    # the seat that leads meets the chain at the same place of the gear: half of it at least shows
    plainly = wave(plain(('steps',)))
    assert max(0.5e-3, 4.0 * plainly) < wave(eccentric) < 4e-3


def test_the_carriage_follows_an_eccentric_gear():
    """A gear that moves by d takes up d (t_in + t_out) / 2 of slack; both strands lead away from it.

    One is level, the other falls by 25.9 deg: cos(25.9 deg / 2) of the amplitude at most.
    """
    turn_s = 2.0 * np.pi / plain(('steps',)).network.rotor[0, 0]
    eccentric = layout_of(deviated('gear_eccentricity', amplitude_m=1e-3))
    way = run(eccentric, [(loop.PART_WAY, 0, 0)], turn_s)[:, 0]
    wave = 2.0 * np.abs(np.fft.rfft(way - way.mean())[1]) / len(way)
    assert wave == pytest.approx(np.cos(np.deg2rad(25.9) / 2.0) * 1e-3, rel=0.1)


def test_rollers_that_roll_freely_ask_for_next_to_nothing():
    """Power has one source: what contacts and links lose is all that the gear must give."""
    roller = replace(SOME.roller, rolling_resistance=0.0, seal_drag_n=0.0, viscous_drag_n_s_m=0.0)
    layout = layout_of(replace(SOME, roller=roller))
    assert 0.0 < run(layout, [(loop.TORQUE, 0, 0)]).mean() < 5.0


def test_preload_moves_the_slack_by_half_of_itself_less_the_springs():
    probes = [(loop.LINK_MEAN, 0, 58), (loop.PART_WAY, 0, 0)]
    before = run(plain(('steps',)), probes).mean(axis=0)
    more = layout_of(deviated('tensioner_preload', factor=1.25))
    after = run(more, probes).mean(axis=0)
    spring = SOME.tensioner.stiffness_n_m * (after[1] - before[1])
    assert after[0] - before[0] == pytest.approx(0.5 * (1000.0 - spring), rel=0.1)


def test_rolling_resistance_adds_to_the_torque():
    probes = [(loop.TORQUE, 0, 0)]
    more = deviated('rolling_resistance', factor=1.6)
    assert alter_machine(more).roller.rolling_resistance == pytest.approx(1.6 * 0.02)
    assert run(layout_of(more), probes).mean() > 1.25 * run(plain(('steps',)), probes).mean()


def test_a_description_brings_deviations():
    machine = replace(SOME, deviations=(Deviation('handrail_drag', {'force_N': 80.0}, {}),))
    layout = layout_of(machine, ('steps', 'handrail'))
    row = layout.network.stretch_drag[0]
    assert row[4] * 254 == pytest.approx(80.0)
    assert (row[0], row[1]) == (18.0, 30.0)  # the handrail's twelve, behind the steps' eighteen
