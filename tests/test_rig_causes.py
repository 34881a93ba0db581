"""The independent generator's machine: closed forms, and what each cause changes."""

import numpy as np
import pytest
from rig.catalogue import KINDS, LISTED, NOT_LISTED
from rig.causes import MACHINE_CAUSES
from rig.comparison import FORCES, TENSIONER
from rig.draw import build, lay_rails, Tolerances
from rig.faults import FAULTS
from rig.guide import lay_path
from rig.instruments import draw_instruments
from rig.machine import Case
from rig.make import ALL_FAULTS, ALTERATIONS, apply_faults, Effect, header, make, Order, streams
from rig.model import RECORD
from rig.recording import record
from rig.run import run, STEP_S
from rig.sheet import Sheet
from rig.unlisted import UNLISTED, UNLISTED_FAULTS
from rig.verify import verify_one

pytestmark = pytest.mark.issue(4)

CASE = Case(0.5, 1, 75.0, 3000.0)
SHORT_S = 3.0  # s, of the runs made here
COARSE_S = 5e-4  # s, integration step where only a change is looked for


@pytest.fixture(scope='module')
def made():
    return make(Order(7, CASE, SHORT_S))


def test_the_guide_closes_with_the_length_of_the_data_sheet():
    path = lay_path(Sheet())
    assert path.start[-1] == pytest.approx(24.4057, abs=5e-5)  # data sheet
    assert path.z[4] == pytest.approx(4.5)  # rise, data sheet
    assert path.x[-1] == pytest.approx(path.x[0])
    assert path.z[-1] == pytest.approx(path.z[0] - 0.9)  # twice the turnaround's radius


@pytest.fixture(scope='module')
def machine():
    """Return the nominal machine."""
    return lay_rails(build(Sheet(), CASE, 0.5, Tolerances()), None)


@pytest.fixture(scope='module')
def nominal_rows(machine):
    """Return its signals while axle 0 goes from the drive into the upper turnaround."""
    return run(machine, 9.0, SHORT_S, SHORT_S + 1.0, every=2, step_s=COARSE_S)


def test_the_carriage_moves_as_the_rigid_polygon_does(nominal_rows):
    u = nominal_rows[:, RECORD.index('u')]
    # the rigid polygon gives 3.3 mm; the elastic machine differs by several percent
    assert np.ptp(u) == pytest.approx(3.3e-3, rel=0.1)


def test_a_finer_step_changes_little(machine):
    rows = [
        run(machine, 9.0, 1.0, 1.0, every=round(5e-3 / h), step_s=h)
        for h in (STEP_S, STEP_S / 3.0)
    ]
    column = RECORD.index('force_left_a')
    apart = (rows[0] - rows[1])[:, column]
    assert apart.std() < 1.5  # N; the gauges' noise is 9.5 N


# cause, place, size, column that must change, by at least this rms
EXPECTED = [
    ('tensioner_friction', {}, {'force_N': 150.0}, 'u', 2e-5),
    ('tensioner_stiffness', {}, {'factor': 0.7}, 'u', 1e-5),
    ('tensioner_preload', {}, {'factor': 0.8}, 'force_left_a', 30.0),
    ('tensioner_stop', {}, {'displacement_m': 2e-3}, 'u', 1e-4),
    ('link_elongation', {'link': 5}, {'length_m': 3e-3}, 'u', 1e-4),
    ('chain_elongation', {'side': 'left'}, {'length_m': 1.5e-4}, 'force_left_a', 50.0),
    ('link_stiffness', {'link': 0, 'side': 'left'}, {'factor': 0.3}, 'force_left_a', 5.0),
    ('roller_drag', {'axle': 0, 'side': 'left'}, {'force_N': 120.0}, 'force_left_a', 5.0),
    (
        'roller_eccentricity',
        {'axle': 0, 'side': 'left'},
        {'amplitude_m': 4e-4},
        'force_left_a',
        5.0,
    ),
    ('roller_flat', {'axle': 0, 'side': 'left'}, {'depth_m': 6e-4}, 'az', 0.05),
    ('rolling_resistance', {}, {'factor': 1.6}, 'force_left_a', 10.0),
    ('friction_speed', {}, {'rise': 1.2, 'speed_m_s': 0.2}, 'force_left_a', 2.0),
    ('guide_step', {'s_m': 9.8, 'side': 'left'}, {'height_m': 1.5e-3}, 'force_left_a', 10.0),
    ('landing_length', {'which': 'upper'}, {'delta_m': 6e-3}, 'u', 1e-4),
    ('guide_drag', {'s_from_m': 13.0, 's_to_m': 15.0}, {'force_N': 50.0}, 'u', 2e-5),
    ('drive_ripple', {}, {'relative_amplitude': 0.02, 'cycles_per_pitch': 0.37}, 'u', 1e-5),
    ('drive_hunting', {}, {'relative_amplitude': 0.012, 'frequency_hz': 0.3}, 'u', 1e-5),
    ('drive_stiffness', {}, {'factor': 0.25}, 'ax', 0.02),
    ('load_distribution', {'steps': [57, 58, 59]}, {'load_factor': 0.0}, 'force_left_a', 2.0),
    ('load_offset', {}, {'left_share': 0.6}, 'force_left_a', 5.0),
    ('step_mass', {'step': 0}, {'delta_kg': 18.0}, 'force_left_a', 2.0),
    (
        'truss_resonance',
        {},
        {'frequency_hz': 6.0, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0},
        'az',
        0.02,
    ),
    ('unlisted_stiffening_spring', {}, {'cubic_n_m3': 1e9}, 'u', 1e-5),
    (
        'unlisted_rubbing_brake',
        {'s_from_m': 2.0, 's_to_m': 4.0},
        {'force_N': 60.0, 'period_s': 3.0, 'on_s': 1.0},
        'force_left_a',
        2.0,
    ),
    ('unlisted_blows', {}, {'force_N': 1500.0, 'period_s': 1.7}, 'u', 1e-5),
    (
        'unlisted_soft_support',
        {'s_from_m': 9.0, 's_to_m': 12.0, 'side': 'both'},
        {'factor': 0.15},
        'u',
        1e-5,
    ),
    ('unlisted_bent_axle', {'axle': 0}, {'offset_m': 2e-3}, 'force_left_a', 2.0),
    (
        'unlisted_second_mode',
        {},
        {'frequency_hz': 9.0, 'damping_ratio': 0.02, 'modal_mass_kg': 3000.0},
        'ax',
        0.02,
    ),
    (
        'unlisted_swinging_load',
        {},
        {'relative_amplitude': 0.08, 'frequency_hz': 0.7},
        'force_left_a',
        5.0,
    ),
    ('unlisted_slipping_dog', {}, {'force_N': 2500.0}, 'u', 1e-5),
    ('unlisted_misplaced_dog', {}, {'dogs': 7, 'offset_m': 1e-3}, 'u', 1e-6),
    ('unlisted_leaking_preload', {}, {'rate_1_s': 1e-2}, 'u', 1e-5),
    ('unlisted_lateral_kink', {'s_m': 9.8}, {'offset_m': 4e-3}, 'ay', 0.005),
    (
        'unlisted_worn_channel',
        {'s_from_m': 13.0, 's_to_m': 16.0, 'side': 'both'},
        {'play_m': 1.5e-3},
        'u',
        1e-5,
    ),
]


@pytest.mark.parametrize(
    ('cause', 'place', 'size', 'column', 'least'), EXPECTED, ids=[e[0] for e in EXPECTED]
)
def test_each_cause_changes_what_it_should(
    machine, nominal_rows, cause, place, size, column, least
):
    altered = ALTERATIONS[cause](machine, place, size, np.random.default_rng(3))
    rows = run(altered, 9.0, SHORT_S, SHORT_S + 1.0, every=2, step_s=COARSE_S)
    change = (rows - nominal_rows)[:, RECORD.index(column)]
    assert np.sqrt(np.mean(change**2)) > least


def test_every_alteration_is_tried_above():
    assert {e[0] for e in EXPECTED} == set(ALTERATIONS)


def test_the_catalogue_holds_every_cause():
    assert set(LISTED) == set(MACHINE_CAUSES) | set(FAULTS)
    assert set(NOT_LISTED) == set(UNLISTED) | set(UNLISTED_FAULTS)
    assert len(NOT_LISTED) >= 8
    assert all(name.startswith('unlisted_') for name in NOT_LISTED)


@pytest.mark.parametrize('cause', sorted(ALL_FAULTS))
def test_each_fault_of_the_measurement_changes_the_samples(cause, made):
    location, parameters = KINDS[cause].draw(np.random.default_rng(5), 1.0)
    if 'to_s' in parameters:  # inside these short recordings
        parameters = {'from_s': 1.0, 'to_s': 2.0}
    series = []
    for effects in ((), (Effect(cause, location, parameters),)):
        order = Order(7, CASE, SHORT_S, effects)
        rng = streams(order)
        kit = draw_instruments(rng['instruments'])
        signals, kit = apply_faults(made.rows, kit, order, Sheet(), rng)
        series.append(record(signals, kit, rng['noise'], header(order)).series)
    same = [
        np.array_equal(before.values, after.values)
        and np.array_equal(before.stamp_ns, after.stamp_ns)
        for before, after in zip(*series, strict=True)
    ]
    assert not all(same)


@pytest.mark.shared
@pytest.mark.slow
def test_the_nominal_machine_meets_another_makers_recording(shared):
    figures = verify_one(shared / 'measured' / 'seeded' / 'clean_2', []).without[2.0]
    for force in FORCES:
        assert figures[force].r > 0.9995
        assert figures[force].residual < 30.0  # N
    assert figures[TENSIONER].r > 0.999
