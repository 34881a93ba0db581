"""Causes at reference size in the running machine: where they show, and where they cannot."""

from dataclasses import replace

import numpy as np
import pytest
import trials
from trials import case, deviation, trial

from escalator_twin.causes import CAUSES, MACHINE_CAUSES
from escalator_twin.signals import Floats

pytestmark = pytest.mark.issue(3)

# One standard deviation of each channel's noise, by quantity: four gauges of 0.25 microstrain
# over EA, the reflex sensor, the accelerometer (data sheet).
NOISE = {
    'link_force': 0.25e-6 * 7.56e7 / 2.0, 'carriage_displacement': 2e-5, 'step_acceleration': 0.02
}  # fmt: skip
CLEAR = 12.0  # standard deviations in a sixth of a loop; over loops 24 and more
SIDED = [name for name, cause in MACHINE_CAUSES.items() if 'side' in {p.key for p in cause.places}]
LOADED = ('load_distribution', 'load_offset')


def whitened(change: Floats) -> dict[str, float]:
    """Return the norm of a change in standard deviations of noise, by quantity."""
    sensors, size = trials.prototype().instruments.sensors, dict.fromkeys(NOISE, 0.0)
    for sensor, column in zip(sensors, change.T, strict=True):
        size[sensor.quantity] += float(((column / NOISE[sensor.quantity]) ** 2).sum())
    return {quantity: value**0.5 for quantity, value in size.items()}


@pytest.fixture(scope='module')
def nominal():
    """Return the runs without deviation, by case."""
    return {load: trial((), (), case(0.5, 1, load), 1.0, 8.0) for load in (0.0, 75.0)}


@pytest.mark.parametrize('name', MACHINE_CAUSES)
def test_a_reference_size_stands_out_where_the_cause_says(name, nominal):
    for reference in MACHINE_CAUSES[name].references:
        item = deviation(name, trials.example(name), **reference)
        run = trial((item,), (), case(), 1.0, 8.0)
        size = whitened(trials.changed(run, nominal[75.0]))
        assert max(size.values()) > CLEAR, size
        seen = {quantity for quantity, value in size.items() if value > 1e-6}
        assert seen <= set(CAUSES[name].acts_on)
        strongest = max(size, key=lambda quantity: size[quantity])
        assert strongest in CAUSES[name].acts_on


@pytest.mark.parametrize('name', LOADED)
def test_a_load_that_is_not_there_has_no_effect(name, nominal):
    run = trial((deviation(name, trials.example(name)),), (), case(0.5, 1, 0.0), 1.0, 8.0)
    assert np.array_equal(run.columns, nominal[0.0].columns)


@pytest.mark.parametrize('name', SIDED)
def test_left_and_right_are_mirror_images(name):
    place = trials.example(name)
    left, right = (
        trial((deviation(name, {**place, 'side': side}),), (), case(), 1.0, 2.0).columns
        for side in ('left', 'right')
    )
    channels = [s.channel for s in trials.prototype().instruments.sensors]
    names = ('left_a', 'left_b', 'right_a', 'right_b')
    force = [channels.index(f'link_force/{name}') for name in names]
    swapped = [force[2], force[3], force[0], force[1]]
    # the two sides are summed in another order, which sliding contacts amplify a little
    assert np.abs(left[:, force] - right[:, swapped]).max() < 1e-3
    lateral = channels.index('step/acceleration/y')
    rest = [i for i in range(len(channels)) if i not in (*force, lateral)]
    assert np.abs(left[:, rest] - right[:, rest]).max() < 1e-6
    assert np.abs(left[:, lateral] - right[:, lateral]).max() < 0.1 * NOISE['step_acceleration']


@pytest.mark.parametrize('name', SIDED)
def test_a_planar_model_sees_the_symmetric_part(name):
    """Both sides together are twice one side where the rows add, the mean where they average."""
    place, machine = trials.example(name), trials.prototype()
    keys = {p.key: p for p in CAUSES[name].places}
    sides = ('left', 'both') if keys['side'].values(machine)[-1] == 'both' else ('left', 'right')
    one, other = (
        trial((deviation(name, {**place, 'side': side}),), (), case(), 1.0, 0.1, planar=True)
        for side in sides
    )
    a, b = one.simulation.parameters, other.simulation.parameters
    plain = trial((), (), case(), 1.0, 0.1, planar=True).simulation.parameters
    for one_side, two_sides, none in zip(a, b, plain, strict=True):
        if sides == ('left', 'right'):
            assert np.array_equal(one_side, two_sides)
        elif np.isfinite(none).all():
            change, both = np.asarray(one_side) - none, np.asarray(two_sides) - none
            assert 2.0 * change == pytest.approx(both, abs=1e-15)


def test_load_on_one_side_is_carried_by_its_chain():
    sensors = tuple(trials.link(i, side) for side in ('left', 'right') for i in (1, 9))
    left, right, plain = (
        trial(items, sensors, case(), 2.0, 1.0).columns
        for items in (
            (deviation('load_offset', left_share=0.6),),
            (deviation('load_offset', left_share=0.4),),
            (),
        )
    )
    assert np.abs(left[:, :2] - right[:, 2:]).max() < 1e-3
    more = (left - plain).mean(axis=0)
    # eight steps on the incline between the links; racking springs share with the other chain
    weight = 8 * 75.0 * 9.81 * 0.1 * np.sin(np.radians(30.0))
    assert 0.3 * weight < more[1] - more[0] < weight
    assert more[3] - more[2] == pytest.approx(-(more[1] - more[0]), rel=0.05)


def test_a_machine_with_many_deviations_runs():
    items = tuple(deviation(name, trials.example(name)) for name in MACHINE_CAUSES)
    machine = replace(trials.prototype(), deviations=items)
    run = trial((), (), case(), 1.0, 2.0, machine)
    assert np.isfinite(run.columns).all()


def test_a_deviation_starts_with_the_phase_it_is_given_every_time():
    item = deviation('drive_hunting', phase_rad=1.0)
    run = trial((item,), (), case(), 1.0, 1.0)
    first = run.columns
    run.simulation.start(1.0)
    again = run.simulation.trace(1.0, trials.RATE_HZ, trials.prototype().instruments.sensors)
    assert np.array_equal(again.columns, first)
