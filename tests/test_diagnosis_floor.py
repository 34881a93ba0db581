"""The file of the twin's own error, and what it makes of a sensor's noise."""

from dataclasses import replace
import json

import numpy as np
import pytest
from scipy import stats
import trials

from escalator_twin.diagnosis import calibrate
from escalator_twin.diagnosis.calibrate import of_campaign
from escalator_twin.diagnosis.floor import (
    CELLS,
    Clean,
    Floor,
    HARMONICS,
    is_shaken,
    kind_of,
    Level,
    ORDERS,
    TEMPERATURE,
)
from escalator_twin.diagnosis.floor_file import (
    borrowed_by,
    load_floor,
    own_floor,
    read_floor,
    write_floor,
)
from escalator_twin.errors import MachineError
from escalator_twin.machine import load_machine

pytestmark = pytest.mark.issue(6)

LINK = 'link_force/left_a'
OWN = 4.0


def level(seed):
    rng = np.random.default_rng(seed)
    return Level(1.0 + rng.exponential(3.0, len(ORDERS) - 1), rng.exponential(10.0, HARMONICS))


@pytest.fixture
def floor():
    return Floor({'link_force': {0.25: level(1), 0.5: level(2)}, 'x/y': {0.5: level(3)}})


def sensor():
    return trials.prototype().instruments.sensor(LINK)


def test_a_file_gives_back_what_was_written(floor, tmp_path):
    path = tmp_path / 'some_floor.yaml'
    write_floor(path, floor, 'of a test')
    assert path.read_text(encoding='utf-8').startswith('# of a test\n')
    again = read_floor(path)
    assert again.levels.keys() == floor.levels.keys()
    for kind, levels in floor.levels.items():
        assert again.levels[kind].keys() == levels.keys()
        for speed, one in levels.items():
            # three digits are written
            np.testing.assert_allclose(again.levels[kind][speed].smooth, one.smooth, rtol=5e-3)
            np.testing.assert_allclose(again.levels[kind][speed].lines, one.lines, rtol=5e-3)


@pytest.mark.parametrize(
    ('text', 'word'),
    [
        ('[]', 'schema'),
        ('schema: other/1\nlevels: []', 'schema'),
        (
            'schema: escalator_twin/floor/1\n'
            'levels: [{kind: link_force, speed_m_s: 0.5, smooth: [1.0], lines: [0.0]}]',
            'smooth',
        ),
    ],
)
def test_a_wrong_file_says_what_is_wrong(tmp_path, text, word):
    path = tmp_path / 'some_floor.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(MachineError, match=word):
        read_floor(path)


def test_an_unknown_kind_has_the_sensors_noise_alone():
    orders = np.linspace(0.0, 20.0, 400)
    variance = Floor({}).variance(sensor(), OWN, orders, 0.5, 4000)
    np.testing.assert_array_equal(variance, OWN)


def test_the_smooth_part_multiplies_the_noise():
    smooth = np.full(len(ORDERS) - 1, 9.0)
    flat = Floor({kind_of(sensor()): {0.5: Level(smooth, np.zeros(HARMONICS))}})
    orders = np.linspace(0.0, 20.0, 400)
    np.testing.assert_allclose(flat.variance(sensor(), OWN, orders, 0.5, 4000), 9.0 * OWN)


def test_a_line_holds_its_power():
    # a wave of mean square P has the sum of squared coefficients n P in an orthonormal transform
    n, power = 4000, 25.0
    lines = np.zeros(HARMONICS)
    lines[2] = power
    one = Floor({kind_of(sensor()): {0.5: Level(np.ones(len(ORDERS) - 1), lines)}})
    orders = np.arange(n) * 2.5e-3
    extra = one.variance(sensor(), OWN, orders, 0.5, n) - OWN
    assert orders[np.argmax(extra)] == pytest.approx(3.0, abs=2.5e-3)
    assert extra.sum() == pytest.approx(n * power, rel=0.02)


def test_between_speeds_lies_between_the_levels(floor):
    orders = np.array([0.3, 0.31, 2.2, 5.3])
    low, middle, high = (
        floor.variance(sensor(), OWN, orders, speed, 4000) for speed in (0.25, 0.35, 0.5)
    )
    assert np.all((middle - low) * (high - middle) >= 0.0)
    np.testing.assert_array_equal(low, floor.variance(sensor(), OWN, orders, 0.1, 4000))


def test_the_prototype_has_a_floor_for_all_its_channels():
    machine = trials.prototype()
    levels = load_floor(machine).levels
    assert {kind_of(s) for s in machine.instruments.sensors} <= set(levels)


def test_a_machine_without_a_file_has_none_and_borrows_the_prototypes():
    machine = trials.toy()
    assert own_floor(machine).levels == {}
    found = load_floor(machine)
    assert found.borrowed == 'prototype'
    assert {kind_of(s) for s in machine.instruments.sensors} >= set(found.levels) != set()
    assert not load_floor(trials.prototype()).borrowed


def test_what_an_extended_machine_has_is_its_bases(root, tmp_path):
    """What `diagnose` writes is diagnosed with the floor of the machine that it extends; under another name it is lent."""
    base = root / 'config' / 'machines' / 'prototype.yaml'
    once, twice = tmp_path / 'once.yaml', tmp_path / 'deeper' / 'twice.yaml'
    twice.parent.mkdir()
    once.write_text(f'extends: {base}\ndeviations: []\n')
    twice.write_text('extends: ../once.yaml\nname: another\n')
    expected = own_floor(trials.prototype()).levels['link_force'][0.5]
    for path, lender in ((once, ''), (twice, 'prototype')):
        machine = load_machine(path)
        assert machine.bases[-1].resolve() == base.resolve()
        found = load_floor(machine)
        assert found.borrowed == lender
        np.testing.assert_array_equal(found.levels['link_force'][0.5].smooth, expected.smooth)
    own = twice.with_name('another_floor.yaml')
    write_floor(own, Floor({'link_force': {0.5: level(9)}}), 'its own')
    found = load_floor(load_machine(twice))
    assert not found.borrowed
    np.testing.assert_allclose(found.levels['link_force'][0.5].smooth, level(9).smooth, rtol=0.01)


def test_a_machine_borrows_from_what_it_extends_before_the_prototype(root, tmp_path):
    lender, borrower = tmp_path / 'lender.yaml', tmp_path / 'borrower.yaml'
    base = root / 'config' / 'machines' / 'prototype.yaml'
    lender.write_text(f'extends: {base}\nname: lender\n')
    borrower.write_text('extends: lender.yaml\nname: borrower\n')
    write_floor(tmp_path / 'lender_floor.yaml', Floor({'link_force': {0.5: level(9)}}), 'lent')
    found = load_floor(load_machine(borrower))
    assert found.borrowed == 'lender'
    np.testing.assert_allclose(found.levels['link_force'][0.5].smooth, level(9).smooth, rtol=0.01)


@pytest.mark.parametrize('noisier', [1.0, 0.5, 3.0])
def test_a_borrowed_floor_is_the_lenders_error_in_si(floor, noisier):
    """Beside a noise of another size: the variance of noise and error is the lender's error and the own noise."""
    lender = trials.prototype()
    instruments = lender.instruments
    sensors = tuple(
        replace(s, noise=noisier * s.noise, resolution=noisier * s.resolution)
        for s in instruments.sensors
    )
    machine = replace(lender, instruments=replace(instruments, sensors=sensors))
    found = borrowed_by(machine, lender, floor)
    orders = np.array([0.3, 1.5, 2.2, 5.3])
    own = noisier**2 * OWN
    error = floor.variance(sensor(), OWN, orders, 0.5, 4000) - OWN
    told = found.variance(sensor(), own, orders, 0.5, 4000) - own
    np.testing.assert_allclose(told, error, rtol=1e-9)
    assert set(found.levels) == {'link_force'}  # the machine has no other kind of channel


def test_a_file_tells_its_temperature(floor, tmp_path):
    path = tmp_path / 'some_floor.yaml'
    write_floor(path, replace(floor, temperature=2.5), 'test')
    assert read_floor(path).temperature == 2.5


def test_the_prototypes_floor_tells_what_good_machines_are_like():
    machine = trials.prototype()
    found = load_floor(machine)
    assert found.temperature >= 1.0
    for sensor_ in machine.instruments.sensors:
        kind = kind_of(sensor_)
        level_log, scatter = found.groups[0].kinds[kind]
        # chi squared over its own floor: about one for each coefficient
        assert abs(level_log) < 3.0 * scatter + 0.2
        assert scatter > 0.0
        has_places = found.levels[kind_of(sensor_)][0.5].spread is not None
        assert has_places == is_shaken(sensor_)


def test_a_floor_that_tells_no_temperature_has_that_of_linked_chains(tmp_path, floor):
    path = tmp_path / 'some_floor.yaml'
    write_floor(path, floor, 'test')
    text = [line for line in path.read_text().splitlines() if not line.startswith('temperature')]
    path.write_text('\n'.join(text))
    assert read_floor(path).temperature == TEMPERATURE


def test_where_a_step_shakes_it_counts_less(floor):
    shaken = next(s for s in trials.prototype().instruments.sensors if is_shaken(s))
    places = np.ones(CELLS)
    places[:7] = 5.0
    one = Floor({kind_of(shaken): {0.5: replace(level(1), spread=places)}})
    share = np.array([0.0, 6.9 / CELLS, 7.1 / CELLS, 0.999])
    np.testing.assert_allclose(one.spread(shaken, share, 0.5), [5.0, 5.0, 1.0, 1.0])
    np.testing.assert_array_equal(floor.spread(sensor(), share, 0.5), np.ones(4))


def test_places_and_good_machines_are_kept_in_the_file(tmp_path):
    kind = kind_of(sensor())
    whole = Floor(
        {kind: {0.5: replace(level(1), spread=np.linspace(0.5, 2.0, CELLS))}},
        groups=(Clean('a maker', 7, {kind: (-0.1, 0.2)}), Clean('another', 4, {kind: (0.1, 0.1)})),
    )
    path = tmp_path / 'some_floor.yaml'
    write_floor(path, whole, 'test')
    again = read_floor(path)
    assert again.groups == whole.groups
    np.testing.assert_allclose(
        again.levels[kind][0.5].spread, whole.levels[kind][0.5].spread, rtol=5e-3
    )


@pytest.mark.parametrize(('count', 'sigmas'), [(4, 2.0), (12, 2.0), (12, 3.0), (40, 2.0)])
def test_one_more_good_machine_passes_as_seldom_as_was_said(count, sigmas):
    # drawn: machines of one scatter, and one more that they do not know
    rng = np.random.default_rng(count)
    known, more = rng.standard_normal((400_000, count)), rng.standard_normal(400_000)
    width = Clean('', count, {'force': (0.0, 1.0)}).limit('force', sigmas)
    limit = known.mean(axis=1) + width * known.std(axis=1, ddof=1)
    expected = stats.norm.sf(sigmas)
    assert np.mean(more > limit) == pytest.approx(expected, abs=4.0 * np.sqrt(expected / 400_000))


def test_a_good_machine_of_any_known_maker_passes():
    ours, theirs = Clean('', 12, {'force': (-0.1, 0.02)}), Clean('', 12, {'force': (0.0, 0.02)})
    both = Floor({}, groups=(ours, theirs))
    assert both.limit('force', 3.0) == theirs.limit('force', 3.0)
    assert both.level_of('force') == -0.1


def test_a_floor_that_knows_no_machines_tells_by_its_whole():
    assert Floor({}, clean=(0.1, 0.2)).limit('force', 3.0) == pytest.approx(0.7)
    assert Floor({}, clean=(0.1, 0.2)).level_of('force') == 0.1


def test_a_floor_of_one_recording_is_refused(tmp_path, floor):
    path = tmp_path / 'some_floor.yaml'
    write_floor(path, replace(floor, groups=(Clean('', 1, {'force': (0.0, 1.0)}),)), 'test')
    with pytest.raises(MachineError, match='recordings: expected a number above 1, found 1'):
        read_floor(path)


def several(path, channel, logs, flagged=()):
    rows = [
        {
            'unexplained': {'significant': k in flagged},
            'residual': {'after': {channel: {'chi2': float(np.exp(log))}}},
        }
        for k, log in enumerate(logs)
    ]
    path.write_text(json.dumps({'by_recording': rows}))
    return path


def test_another_makers_recordings_count_beside_their_effects(tmp_path):
    machine = trials.prototype()
    sensor = machine.instruments.sensors[0]
    # the last holds more than what is named in it, and tells nothing of good machines
    path = several(tmp_path / 'a.json', sensor.channel, (0.0, 0.2, 0.1, 3.0), flagged=[3])
    found = of_campaign(path, machine)
    assert found.recordings == 3
    assert found.kinds == {kind_of(sensor): pytest.approx((0.1, 0.1))}


def test_a_campaign_with_open_ends_calibrates_nothing(tmp_path):
    machine = trials.prototype()
    channel = machine.instruments.sensors[0].channel
    path = several(tmp_path / 'a.json', channel, (0.0, 0.2, 0.1), flagged=[1])
    with pytest.raises(MachineError, match=r'expected 3 recordings .* found 2'):
        of_campaign(path, machine)


def test_calibration_of_nothing_writes_nothing(tmp_path, monkeypatch, capsys):
    out = tmp_path / 'floor.yaml'
    monkeypatch.setattr('sys.argv', ['calibrate', '--out', str(out)])
    with pytest.raises(SystemExit):
        calibrate.main()
    assert 'expected recordings or --beside' in capsys.readouterr().err
    assert not out.exists()
