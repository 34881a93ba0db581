"""The independent generator's machine: closed forms, and what each cause changes."""

import numpy as np
import pytest
from rig.catalogue import KINDS, LISTED, NOT_LISTED, SHARES
from rig.causes import MACHINE_CAUSES
from rig.draw import (
    build,
    lay_rails,
    SURVEY_ERROR_M,
    Tolerances,
    true_rail,
    WAVE_AMPLITUDE_M,
)
from rig.faults import FAULTS
from rig.guide import lay_path, read_survey
from rig.instruments import draw_instruments, LINKS
from rig.machine import Case, SURVEY
from rig.make import ALL_FAULTS, ALTERATIONS, apply_faults, Effect, header, make, Order, streams
from rig.model import RECORD
from rig.recording import record
from rig.run import run, STEP_S
from rig.sheet import Sheet
from rig.unlisted import UNLISTED
from rig.unlisted_faults import UNLISTED_FAULTS

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


def test_the_likeliest_rail_has_the_survey_at_its_own_places():
    sheet = read_survey(SURVEY)
    s, length = sheet[:, 0], 24.4057  # m, data sheet
    # waves longer than a metre, which a survey error of 0.05 mm hardly touches, given to the rig
    k = np.arange(1, 24)
    smooth = np.cos(2.0 * np.pi * np.outer(s / length, k) + k) @ (3e-4 / k)
    rail = true_rail(s, smooth, length, WAVE_AMPLITUDE_M['lateral'], None)
    grid = np.arange(rail.size) * (length / rail.size)
    truth = np.cos(2.0 * np.pi * np.outer(grid / length, k) + k) @ (3e-4 / k)
    assert np.abs(rail - truth).max() < 1e-5  # m; a place 4 cm off would leave ten times that


def test_drawn_rails_scatter_about_the_likeliest_as_the_survey_allows():
    sheet, length = read_survey(SURVEY), 24.4057
    given = (sheet[:, 0], sheet[:, 1], length, WAVE_AMPLITUDE_M['normal'])
    likeliest = true_rail(*given, None)
    drawn = np.stack([true_rail(*given, np.random.default_rng(k)) for k in range(40)])
    # no better than the mean of all waves at one row, no worse than the row itself
    scatter = drawn.std(axis=0)
    assert 0.2 * SURVEY_ERROR_M < scatter.mean() < SURVEY_ERROR_M
    assert np.abs(drawn.mean(axis=0) - likeliest).mean() < 0.3 * scatter.mean()


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
    (
        'unlisted_settled_rail',
        {'s_m': 9.8, 'side': 'left'},
        {'depth_m': 4e-3, 'length_m': 1.0},
        'az',
        0.01,
    ),
    (
        'unlisted_corrugated_rail',
        {'s_from_m': 9.0, 's_to_m': 11.0, 'side': 'left'},
        {'amplitude_m': 2e-4, 'wavelength_m': 0.2},
        'az',
        0.01,
    ),
    (
        'unlisted_high_rail',
        {'s_from_m': 8.0, 's_to_m': 11.0, 'side': 'left'},
        {'height_m': 1e-3},
        'force_left_a',
        2.0,
    ),
    ('unlisted_dry_side', {'side': 'left'}, {'factor': 2.0}, 'force_left_a', 10.0),
    ('unlisted_poor_batch', {'axle': 0}, {'force_N': 60.0, 'one_of': 4}, 'force_left_a', 5.0),
    ('unlisted_alternating_links', {}, {'length_m': 3e-4}, 'u', 1e-5),
    ('unlisted_soft_side', {'side': 'left'}, {'factor': 0.7}, 'force_left_a', 2.0),
    ('unlisted_damped_tensioner', {}, {'factor': 10.0}, 'u', 1e-5),
    ('unlisted_warming_grease', {}, {'rate_1_s': 0.03}, 'force_left_a', 1.0),
    ('unlisted_uneven_loads', {}, {'sd': 0.3}, 'force_left_a', 2.0),
    ('unlisted_heavy_carriage', {}, {'mass_kg': 300.0}, 'u', 1e-5),
    ('unlisted_heavy_side', {'side': 'left'}, {'factor': 1.15}, 'force_left_a', 5.0),
    ('unlisted_half_loaded', {}, {'early_m': 3.0}, 'force_left_a', 50.0),
    ('unlisted_thick_grease', {}, {'factor': 8.0}, 'force_left_a', 10.0),
    ('unlisted_damped_links', {}, {'factor': 2.5}, 'force_left_a', 0.5),
    ('unlisted_lower_landing', {}, {'delta_m': 6e-3}, 'force_left_a', 2.0),
    ('unlisted_short_dogs', {}, {'short_m': 0.08}, 'u', 1e-5),
    (
        'unlisted_seizing_roller',
        {'axle': 0, 'side': 'left'},
        {'rate_N_s': 40.0},
        'force_left_a',
        5.0,
    ),
    ('unlisted_warming_chain', {}, {'rate_1_s': 1e-4}, 'u', 1e-4),
    ('unlisted_graded_chain', {}, {'length_m': 2e-4}, 'u', 1e-5),
    ('unlisted_soft_tyres', {}, {'factor': 0.4}, 'az', 0.005),
    ('unlisted_soft_flanks', {}, {'factor': 0.4}, 'ay', 0.002),
    (
        'unlisted_rail_joints',
        {'s_m': 9.8, 'side': 'both'},
        {'height_m': 4e-4, 'spacing_m': 1.5},
        'force_left_a',
        2.0,
    ),
    ('unlisted_speed_jump', {}, {'relative': 0.02, 'at_share': 0.4}, 'rack', 5e-3),
    ('unlisted_boarding', {}, {'share': 0.4, 'at_s': 0.5}, 'force_left_a', 10.0),
    ('unlisted_shaken_carriage', {}, {'force_N': 200.0, 'frequency_hz': 7.0}, 'u', 1e-5),
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


def test_a_frame_that_sags_moves_everything_alike(machine):
    """Where a frame stands is no force: a loop's tensions are those of a rigid one, place by place."""
    frame = {'frequency_hz': 4.87, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}
    column = RECORD.index('force_left_a')
    loop_s = machine.loop / machine.speed
    means = []
    bouncing = MACHINE_CAUSES['truss_resonance'](machine, {}, frame, None)
    for model in (machine, bouncing._replace(mode_carried=0.0)):
        rows = run(model, 9.0, 4.0, loop_s, every=2, step_s=COARSE_S)
        means.append([part.mean() for part in np.array_split(rows[:, column], 24)])
        sag = rows[:, RECORD.index('mode')].mean()
    assert sag < -2e-3  # the chain's weight over the frame's stiffness
    # a frame that stood for a force: 12 N; where the link enters the drive it is a matter of moments
    assert np.median(np.abs(np.subtract(*means))) < 3.0


def test_a_bouncing_frame_was_surveyed_under_its_chain(machine):
    """The rollers meet the rail where it was surveyed: about there the frame bounces."""
    loaded = machine._replace(load=np.full_like(machine.load, 37.5))
    frame = {'frequency_hz': 4.87, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}
    bouncing = MACHINE_CAUSES['truss_resonance'](loaded, {}, frame, None)
    rows = run(bouncing, 9.0, 6.0, 12.0, every=2, step_s=COARSE_S)
    assert (
        abs(rows[:, RECORD.index('mode')].mean()) < 3e-4
    )  # its chain's weight would make it 8 mm


def test_every_alteration_is_tried_above():
    assert {e[0] for e in EXPECTED} == set(ALTERATIONS)


def test_the_catalogue_holds_every_cause():
    assert set(LISTED) == set(MACHINE_CAUSES) | set(FAULTS)
    assert set(NOT_LISTED) == set(UNLISTED) | set(UNLISTED_FAULTS)
    assert len(NOT_LISTED) >= 20
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


@pytest.mark.parametrize('first', [True, False])
def test_exchanged_plugs_take_a_gauges_creep_along_in_whatever_order_it_is_told(made, first):
    """Creep of right_a's gauges is recorded as left_b's; outliers stay in the channel that they are told of."""
    swap = Effect('channel_swap', {'channels': ['link_force/right_a', 'link_force/left_b']}, {})
    creep = Effect('gauge_drift', {'link': 'right_a'}, {'strain': 1e-3})
    outliers = Effect('sensor_spikes', {'channel': 'link_force/left_b'}, {'count': 5})
    found = []
    for further in ((), (creep,), (outliers,)):
        order = Order(7, CASE, SHORT_S, (swap, *further) if first else (*further, swap))
        rng = streams(order)
        kit = draw_instruments(rng['instruments'])
        found.append(apply_faults(made.rows, kit, order, Sheet(), rng)[0].strain)
    plain, crept, spiked = found
    for other in (crept, spiked):
        changed = [LINKS[k] for k in range(len(LINKS)) if not np.array_equal(plain[k], other[k])]
        assert changed == ['left_b']


SCALES = {  # how far a parameter is from doing nothing, where that is not its value itself
    'factor': lambda value: value - 1.0,
    'load_factor': lambda value: value - 1.0,
    'left_share': lambda value: value - 0.5,
    'share_of_motion': lambda value: 1.0 - value,
    'share_of_peak': lambda value: 1.0 - value,
    'modal_mass_kg': lambda value: 1.0 / value,
}
SOFTENS = ('link_stiffness', 'drive_stiffness', 'unlisted_soft_support')
REFERENCES = {  # the project's list of causes
    'tensioner_friction': {'force_N': (150.0,)},
    'tensioner_stiffness': {'factor': (0.7, 1.4)},
    'tensioner_preload': {'factor': (0.8, 1.25)},
    'link_elongation': {'length_m': (3e-3,)},
    'chain_elongation': {'length_m': (1.5e-4,)},
    'link_stiffness': {'factor': (0.3,)},
    'roller_drag': {'force_N': (120.0,)},
    'roller_eccentricity': {'amplitude_m': (4e-4,)},
    'roller_flat': {'depth_m': (6e-4,)},
    'rolling_resistance': {'factor': (1.6, 0.6)},
    'friction_speed': {'rise': (1.2,)},
    'guide_step': {'height_m': (1.5e-3,)},
    'landing_length': {'delta_m': (6e-3, -6e-3)},
    'guide_drag': {'force_N': (50.0,)},
    'drive_ripple': {'relative_amplitude': (0.02,)},
    'drive_hunting': {'relative_amplitude': (0.012,)},
    'drive_stiffness': {'factor': (0.25,)},
    'load_distribution': {'load_factor': (0.0, 1.8)},
    'load_offset': {'left_share': (0.6, 0.4)},
    'step_mass': {'delta_kg': (18.0, -18.0)},
    'truss_resonance': {'modal_mass_kg': (4500.0,)},
    'gauge_gain': {'factor': (1.09, 0.91)},
    'gauge_drift': {'strain': (1e-5, -1e-5)},
    'clock_drift': {'ppm': (900.0, -900.0)},
    'mains_hum': {'strain': (6e-6,)},
}


def away(cause: str, name: str, value: float) -> float:
    """Return how far a parameter is from doing nothing."""
    if cause in SOFTENS:
        return float(np.log(value))
    return float(SCALES.get(name, lambda v: v)(value))


@pytest.mark.parametrize('cause', sorted(REFERENCES))
def test_sizes_are_exact_shares_of_the_reference(cause):
    for share in SHARES.values():
        found = [KINDS[cause].draw(np.random.default_rng(k), share)[1] for k in range(20)]
        for name, references in REFERENCES[cause].items():
            allowed = share * np.array([away(cause, name, r) for r in references])
            drawn = np.array([away(cause, name, size[name]) for size in found])
            least = np.abs(drawn[:, None] - allowed).min(axis=1)
            assert least.max() < 1e-9 * np.abs(allowed).max()
            # and what is drawn is possible
            assert all(size.get('factor', 1.0) > 0.0 for size in found)
            assert all(size.get('load_factor', 1.0) >= 0.0 for size in found)


def test_sizes_that_are_no_single_number_are_exact_too():
    for share in SHARES.values():
        rng = np.random.default_rng(1)
        turn = KINDS['accelerometer_misalignment'].draw(rng, share)[1]
        assert np.linalg.norm(list(turn.values())) == pytest.approx(4.0 * share)  # deg
        gap = KINDS['data_gap'].draw(rng, share)[1]
        assert gap['to_s'] - gap['from_s'] == pytest.approx(4.0 * share)  # s
        assert KINDS['sensor_spikes'].draw(rng, share)[1]['count'] == round(20.0 * share)
        # the upper half of the motion: half of it at 0, its end at 1
        assert 0.0 < KINDS['tensioner_stop'].draw(rng, share)[1]['share_of_motion'] < 1.0
