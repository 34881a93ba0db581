"""The contract over the registry: every cause has its law's numbers, and none acts when neutral."""

from dataclasses import replace
from math import inf
import re

import numpy as np
import pytest
import trials
import yaml

from escalator_twin.causes import (
    alter_machine,
    alter_parameters,
    apply,
    CAUSES,
    MACHINE_CAUSES,
)
from escalator_twin.causes.base import HOOKS
from escalator_twin.errors import MachineError
from escalator_twin.machine import Deviation, load_machine, Machine
from escalator_twin.physics.parameters import make_parameters, Parameters
from escalator_twin.twin import make_simulation

pytestmark = pytest.mark.issue(3)

OF_MACHINE = [
    'tensioner_friction',
    'tensioner_stiffness',
    'tensioner_preload',
    'tensioner_stop',
    'link_elongation',
    'chain_elongation',
    'link_stiffness',
    'roller_drag',
    'roller_eccentricity',
    'roller_flat',
    'rolling_resistance',
    'friction_speed',
    'guide_step',
    'landing_length',
    'guide_drag',
    'drive_ripple',
    'drive_hunting',
    'drive_stiffness',
    'load_distribution',
    'load_offset',
    'step_mass',
    'truss_resonance',
]
OF_MEASUREMENT = [
    'gauge_gain',
    'gauge_drift',
    'gauge_dead',
    'accelerometer_misalignment',
    'axis_inverted',
    'channel_swap',
    'clock_drift',
    'mains_hum',
    'data_gap',
    'sensor_spikes',
]
SECOND_MACHINE = ('gear_eccentricity', 'handrail_drag')
QUANTITIES = {
    'link_force', 'roller_normal_force', 'carriage_displacement', 'step_acceleration'
}  # fmt: skip
LOCKS = {'guide', 'link', 'travel', 'time', 'load', 'side', 'sample'}
everything = pytest.mark.parametrize('name', CAUSES)
of_machine = pytest.mark.parametrize('name', MACHINE_CAUSES)


def parameters(machine: Machine) -> Parameters:
    altered = alter_machine(machine)
    return alter_parameters(make_parameters(altered, trials.case()), altered)


def same(one: Parameters, other: Parameters) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_the_registry_holds_the_contract_and_nothing_by_accident():
    assert sorted(CAUSES) == sorted(OF_MACHINE + OF_MEASUREMENT)
    assert sorted(MACHINE_CAUSES) == sorted(OF_MACHINE)


@everything
def test_a_cause_is_complete(name):
    cause = CAUSES[name]
    assert cause.name == name
    assert sum(getattr(cause, hook) is not None for hook in HOOKS) == 1
    assert cause.law
    assert cause.source
    assert set(cause.acts_on) <= QUANTITIES
    assert cause.acts_on
    assert set(cause.locked_to) <= LOCKS
    assert cause.locked_to
    assert set(cause.alike) <= set(CAUSES) - {name}
    for p in cause.parameters:
        assert p.unit
        assert p.low < p.high
    for reference in cause.references:
        assert set(reference) <= {p.name for p in cause.parameters}
        complete = cause.complete(reference)
        assert any(complete[p.name] != p.neutral for p in cause.sizes) or not cause.sizes


@everything
def test_every_cause_says_its_law_limits_and_likeness(name):
    module = __import__(f'escalator_twin.causes.{name}', fromlist=['CAUSE'])
    for heading in ('Law', 'Limits', 'Alike'):
        assert f'\n{heading}\n---' in module.__doc__
    for other in module.CAUSE.alike:
        assert other in module.__doc__


@pytest.mark.parametrize('name', [n for n, cause in CAUSES.items() if cause.sizes])
def test_a_neutral_size_changes_no_number_and_no_input(name):
    machine, cause = trials.prototype(), CAUSES[name]
    neutral = Deviation(name, dict(cause.neutral()), trials.example(name))
    before = parameters(machine)
    assert same(parameters(apply(machine, (neutral,))), before)
    assert same(parameters(machine), before)
    assert machine.deviations == ()


@of_machine
def test_a_reference_size_changes_numbers_and_leaves_the_input(name):
    machine, cause = trials.prototype(), CAUSES[name]
    before = parameters(machine)
    kept = Parameters(*(np.array(v, copy=True) for v in before))
    for reference in cause.references:
        item = Deviation(name, dict(reference), trials.example(name))
        assert not same(parameters(apply(machine, (item,))), before)
    assert same(before, kept)


@of_machine
def test_every_place_of_a_machine_is_admitted(name):
    for machine in (trials.prototype(), trials.toy()):
        places = CAUSES[name].candidates(machine)
        keys = {tuple(sorted(map(str, place.items()))) for place in places}
        assert len(keys) == len(places) > 0
        for place in (places[0], places[-1]):
            full = {**trials.example(name), **place, 's_m': 0.5, 's_from_m': 0.2, 's_to_m': 0.9}
            location = {p.key: full[p.key] for p in CAUSES[name].places}
            assert CAUSES[name].locate(location, machine) is not None


def test_places_count_what_the_machine_has():
    prototype, toy = trials.prototype(), trials.toy()
    assert len(CAUSES['roller_drag'].candidates(prototype)) == 120
    assert len(CAUSES['roller_drag'].candidates(toy)) == 24
    assert len(CAUSES['chain_elongation'].candidates(prototype)) == 3
    links = [place['link'] for place in CAUSES['gauge_gain'].candidates(prototype)]
    assert links == ['left_a', 'left_b', 'right_a', 'right_b']
    assert [p['link'] for p in CAUSES['gauge_gain'].candidates(toy)] == ['pull']


WRONG = [
    (Deviation('tensioner_fricton', {}), r'deviations\[0\]\.cause: expected one of tensioner_fr'),
    (Deviation('tensioner_friction', {}), r'\(tensioner_friction\)\.parameters\.force_N: missing'),
    (Deviation('tensioner_friction', {'force': 1.0}), r'parameters\.force: unknown; expected for'),
    (Deviation('tensioner_friction', {'force_N': -1.0}), r'from 0 to 3000 N, found -1\.0'),
    (Deviation('tensioner_friction', {'force_N': 'much'}), r"from 0 to 3000 N, found 'much'"),
    (Deviation('tensioner_friction', {'force_N': 5.0}, {'link': 3}), r'location\.link: unknown'),
    (Deviation('roller_drag', {'force_N': 5.0}), r'location\.axle: missing; expected axle, side'),
    (Deviation('roller_drag', {'force_N': 5.0}, {'axle': 60, 'side': 'left'}),
     r'location\.axle: expected a whole number from 0 to 59, found 60'),
    (Deviation('roller_drag', {'force_N': 5.0}, {'axle': 4, 'side': 'lower'}),
     r"location\.side: expected one of left, right, found 'lower'"),
    (Deviation('guide_step', {'height_m': 1e-3}, {'s_m': 24.5, 'side': 'left'}),
     r'location\.s_m: expected a number from 0 to 24\.4057 m, found 24\.5'),
    (Deviation('load_distribution', {'load_factor': 0.0}, {'steps': [3, 3]}), r'location\.steps'),
    (Deviation('load_distribution', {'load_factor': 0.0}, {'steps': 3}), r'location\.steps'),
    (Deviation('load_distribution', {'load_factor': 0.0}, {'steps': [61]}), r'steps: expected on'),
    (Deviation('landing_length', {'delta_m': 1e-3}, {'which': 'lower'}), r'which: expected one '),
    (Deviation('gauge_gain', {'factor': 1.1}, {'link': 'left_c'}), r'expected one of left_a, le'),
    (Deviation('data_gap', {'from_s': 1.0}, {'channels': ['left_a']}), r'parameters\.to_s: miss'),
]  # fmt: skip


@pytest.mark.parametrize(('wrong', 'message'), WRONG, ids=[w[1][:40] for w in WRONG])
def test_a_wrong_deviation_is_one_clear_line(wrong, message):
    machine = replace(trials.prototype(), deviations=(wrong,))
    with pytest.raises(MachineError, match=message) as error:
        make_simulation(machine, trials.case())
    assert 'prototype.yaml' in str(error.value)
    assert '\n' not in str(error.value)


def test_yaml_alone_brings_deviations(tmp_path):
    text = {
        'extends': str(trials.ROOT / 'config/machines/prototype.yaml'),
        'schema': 'escalator_twin/machine/1',
        'deviations': [
            {'cause': 'roller_drag', 'location': {'axle': 44, 'side': 'left'},
             'parameters': {'force_N': 120.0}},
            {'cause': 'tensioner_friction', 'parameters': {'force_N': '1.5e2'}},
        ],
    }  # fmt: skip
    file = tmp_path / 'worn.yaml'
    file.write_text(yaml.safe_dump(text))
    simulation = make_simulation(load_machine(file), trials.case())
    assert simulation.parameters.roller_drag[0, 44] == 120.0
    assert simulation.parameters.roller_drag.sum() == 120.0
    assert simulation.parameters.carriage_friction == 150.0


def test_deviations_of_one_kind_add_up():
    machine = trials.prototype()
    twice = (trials.deviation('rolling_resistance', factor=1.2),) * 2
    factor = parameters(apply(machine, twice)).rolling_resistance[0, 0] / 0.025
    assert factor == pytest.approx(1.44, rel=1e-12)
    stops = (trials.deviation('tensioner_stop', displacement_m=x) for x in (inf, 4e-3, 5e-3))
    assert parameters(apply(machine, tuple(stops))).carriage_stop == 4e-3


@everything
def test_the_overview_names_every_cause_and_parameter(name):
    page = (trials.ROOT / 'docs/causes.md').read_text(encoding='utf-8')
    (row,) = re.findall(rf'^\| `{name}` .*$', page, re.MULTILINE)
    for key in [p.name for p in CAUSES[name].parameters] + [p.key for p in CAUSES[name].places]:
        assert f'`{key}`' in row


def read_contract(text: str) -> dict[str, list[str]]:
    """Return the rows of the two tables of causes, by name."""
    rows = re.findall(r'^\| (`.*) \|$', text[text.index('## Causes') :], re.MULTILINE)
    table = {}
    for row in rows:
        cells = [cell.strip() for cell in row.split('|')]
        for name in re.findall(r'`(\w+)`', cells[0]):
            table[name] = cells
    return table


@pytest.mark.shared
@everything
def test_names_keys_and_sizes_are_those_of_the_contract(name, shared):
    table = read_contract((shared / 'contracts.md').read_text(encoding='utf-8'))
    assert set(table) == set(CAUSES) | set(SECOND_MACHINE)
    _, location, sizes, _, reference, tolerance = table[name]
    cause = CAUSES[name]
    assert [p.key for p in cause.places] == re.findall(r'`(\w+)`', location)[: len(cause.places)]
    named = re.findall(r'`(\w+)`', sizes)
    assert [p.name for p in cause.parameters][: len(named)] == named
    numbers = [float(x) for x in re.findall(r'(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?', reference)]
    known = {value for r in cause.references for value in r.values()}
    if numbers and name not in ('data_gap', 'load_distribution'):
        assert set(numbers) <= known
    if re.fullmatch(r'[\d.e-]+', tolerance):
        assert cause.sizes[0].tolerance == float(tolerance)
