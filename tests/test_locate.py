"""What can be known of a recording from a part of its signals, and what is said to be unknown."""

from dataclasses import replace
import json

from mcap.writer import Writer
import numpy as np
import pytest

from escalator_twin import bagfile, campaign, pipeline
from escalator_twin.causes.application import apply
from escalator_twin.check.quality import quality
from escalator_twin.comparison import locate
from escalator_twin.comparison.document import recording_document
from escalator_twin.errors import EscalatorError, RecordingError, SynchronisationError
from escalator_twin.machine import Deviation, load_machine
from escalator_twin.physics.path import build_path
from escalator_twin.signals import Experiment, Recording
from escalator_twin.sync.place import GAIN
from escalator_twin.sync.timeline import Timed

pytestmark = pytest.mark.issue(5)


@pytest.fixture(scope='module')
def machine(root):
    """Return the prototype."""
    return load_machine(root / 'config' / 'machines' / 'prototype.yaml')


@pytest.fixture(scope='module')
def sample(root, machine):
    """Return the sample recording and its truth, which only the assertions read."""
    truth = json.loads((root / 'bags' / 'truth' / 'sample_clean.json').read_text())
    return bagfile.read(root / 'bags' / 'sample_clean', machine), truth


def compared(recording, machine):
    """Return the recording's part of the JSON."""
    setting, judgement = pipeline.compare_recording(recording, machine)
    return recording_document(recording, setting, judgement, machine)


def only(recording, *words):
    """Return the recording with the channels that hold one of the words."""
    signals = {c: s for c, s in recording.signals.items() if any(w in c for w in words)}
    return replace(recording, signals=signals)


def turned(recording, channel):
    """Return the recording with one channel's sign turned."""
    old = recording.signals[channel]
    signal = replace(old, values=-old.values, parts=-old.parts)
    return replace(recording, signals={**recording.signals, channel: signal})


def repaired(found):
    """Return kind and channel of what was repaired."""
    return {(f['kind'], f['channel']) for f in found['quality'] if f['repaired']}


def off_mm(found, truth, machine):
    """Return the error of the place, mm, the short way round the loop."""
    length = build_path(machine.guide).length_m
    return 1e3 * ((found['start_s_m'] - truth['start_s_m'] + length / 2) % length - length / 2)


def test_speed_place_and_clocks_are_found(sample, machine):
    recording, truth = sample
    found = compared(recording, machine)
    assert found['speed_m_s']['value'] == pytest.approx(truth['speed_m_s'], rel=1e-3)
    assert abs(off_mm(found, truth, machine)) < 15.0
    assert found['clock']['offset_s'] == pytest.approx(truth['clock']['offset_s'], abs=5e-3)
    assert found['clock']['drift_ppm'] == pytest.approx(truth['clock']['drift_ppm'], abs=5.0)
    signals = found['clock']['by_signals']
    assert signals['offset_s'] == pytest.approx(truth['clock']['offset_s'], abs=15e-3)


@pytest.mark.parametrize('words', [('acceleration',), ('left_a',), ('link_force',)])
def test_some_channels_alone_tell_the_place(sample, machine, words):
    recording, truth = sample
    found = compared(only(recording, *words), machine)
    assert found['place_is_certain']
    # the bar of 15 mm is that of a whole recording, above; what forces alone leave open is the
    # phase of the carriage's resonance, some millimetres more
    assert abs(off_mm(found, truth, machine)) < 20.0
    assert found['clock']['offset_s'] is None


def test_the_tensioner_alone_does_not_tell_the_place(sample, machine):
    recording, truth = sample
    found = compared(only(recording, 'tensioner'), machine)
    assert not found['place_is_certain']
    assert found['start_s_m'] is None
    assert found['speed_m_s']['value'] == pytest.approx(truth['speed_m_s'], rel=1e-3)


def test_signals_tie_the_clocks_where_bag_time_equals_the_stamps(sample, machine):
    recording, truth = sample
    signals = {c: replace(s, bag_ns=s.stamp_ns) for c, s in recording.signals.items()}
    found = compared(replace(recording, signals=signals), machine)
    assert not found['clock']['by_bag_time']['offset_s']
    assert abs(off_mm(found, truth, machine)) < 15.0
    period = machine.chain.pitch_m / truth['speed_m_s']
    error = found['clock']['offset_s'] - truth['clock']['offset_s']
    assert abs((error + period / 2) % period - period / 2) < 15e-3
    assert found['clock']['drift_ppm'] == pytest.approx(truth['clock']['drift_ppm'], abs=15.0)


def test_an_inverted_axis_and_exchanged_links_are_named_and_put_back(sample, machine):
    recording, truth = sample
    signals = dict(recording.signals)
    x = signals['step/acceleration/x']
    signals['step/acceleration/x'] = replace(x, values=-x.values, parts=-x.parts)
    a, b = signals['link_force/left_a'], signals['link_force/right_b']
    signals['link_force/left_a'] = replace(b, channel=a.channel)
    signals['link_force/right_b'] = replace(a, channel=b.channel)
    found = compared(replace(recording, signals=signals), machine)
    kinds = {(f['kind'], f['channel'], f['repaired']) for f in found['quality']}
    assert ('axis_inverted', 'step/acceleration/x', True) in kinds
    assert ('channel_swap', 'link_force/left_a', True) in kinds
    assert abs(off_mm(found, truth, machine)) < 15.0
    assert found['channels']['link_force/left_a']['r_time'] > 0.999
    assert found['channels']['step/acceleration/x']['r_time'] > 0.999


@pytest.mark.issue(6)
def test_a_tensioners_sensor_that_is_mounted_the_wrong_way_is_turned_where_clocks_are_tied(
    sample, machine
):
    recording, _ = sample
    channel = 'tensioner/displacement'
    negative = turned(recording, channel)
    found = compared(negative, machine)
    assert ('axis_inverted', channel) in repaired(found)
    assert found['channels'][channel]['r_time'] > 0.999
    # by its waves alone a tensioner may as well be half a pitch away
    untied = {c: replace(s, bag_ns=s.stamp_ns) for c, s in negative.signals.items()}
    found = compared(replace(recording, signals=untied), machine)
    assert not [f for f in found['quality'] if f['kind'] == 'axis_inverted']


@pytest.mark.parametrize(
    ('channel', 'factor', 'unit'),
    [
        ('step/acceleration/x', 1.0 / 9.80665, 'as in g'),
        ('link_force/right_a', 1e6, 'as in 1e-6'),
        ('tensioner/displacement', 1e3, 'as in mm'),
    ],
)
def test_a_channel_in_another_unit_is_refused(sample, machine, channel, factor, unit):
    recording, _ = sample
    signals = dict(recording.signals)
    old = signals[channel]
    signals[channel] = replace(old, values=factor * old.values, parts=factor * old.parts)
    with pytest.raises(RecordingError, match=f'sample_clean: {channel}: reads .* {unit}'):
        compared(replace(recording, signals=signals), machine)


def test_a_recording_that_ran_the_other_way_is_refused(sample, machine):
    recording, _ = sample
    told = replace(recording.experiment, direction=-recording.experiment.direction)
    way = {1: 'up', -1: 'down'}
    text = f'says {way[told.direction]}, and .* runs {way[-told.direction]}: link_force/'
    with pytest.raises(SynchronisationError, match=text):
        compared(replace(recording, experiment=told), machine)


@pytest.mark.issue(6)
def test_a_link_whose_bridge_is_plugged_the_wrong_way_is_turned(sample, machine):
    recording, truth = sample
    channel = 'link_force/left_b'
    negative = turned(recording, channel)
    found = compared(negative, machine)
    assert ('axis_inverted', channel) in repaired(found)
    assert abs(off_mm(found, truth, machine)) < 15.0
    assert found['channels'][channel]['r_time'] > 0.999
    assert not [f for f in found['quality'] if f['kind'] == 'channel_swap']


@pytest.mark.issue(6)
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_sideways_axis_is_turned_by_its_waves(sample, machine, sign):
    # gravity says nothing of y: what it does to a turned sensor has either sign
    recording, truth = sample
    signals = dict(recording.signals)
    y, x = signals['step/acceleration/y'], signals['step/acceleration/x']
    values = sign * y.values - 0.05 * x.values[: len(y.values)]
    signals[y.channel] = replace(y, values=values, parts=values[:, None])
    found = compared(replace(recording, signals=signals), machine)
    turned = [f['channel'] for f in found['quality'] if f['kind'] == 'axis_inverted']
    assert turned == ([y.channel] if sign < 0.0 else [])
    assert found['channels'][y.channel]['r_time'] > 0.8
    assert abs(off_mm(found, truth, machine)) < 15.0


@pytest.mark.issue(6)
@pytest.mark.parametrize('own', [0.0, -0.6])
def test_an_axis_that_follows_nothing_surely_is_left_alone(sample, machine, own):
    recording, _ = sample
    signals = dict(recording.signals)
    y = signals['step/acceleration/y']
    # another place's waves; beside them its own are a guess
    values = own * y.values - 3.0 * y.values[::-1]
    signals[y.channel] = replace(y, values=values, parts=values[:, None])
    found = compared(replace(recording, signals=signals), machine)
    assert not [f for f in found['quality'] if f['kind'] == 'axis_inverted']


@pytest.mark.issue(6)
def test_outliers_that_the_force_hides_are_counted_beside_the_twin(sample, machine):
    recording, truth = sample
    signals = dict(recording.signals)
    force = signals['link_force/left_a']
    n = len(force.values)
    noise = float(np.std(np.diff(force.values, 2))) / np.sqrt(6.0)
    at = np.sort(np.random.default_rng(7).choice(n - 400, 24, replace=False)) + 200
    parts = np.array(force.parts)
    parts[at] += np.tile([60.0, -14.0], 12)[:, None] * noise
    signals[force.channel] = replace(force, values=parts.mean(axis=1), parts=parts)
    recording = replace(recording, signals=signals)
    alone = [f.detail for f in quality(recording, machine) if f.kind == 'sensor_spikes']
    setting, judgement = pipeline.compare_recording(recording, machine)
    found = recording_document(recording, setting, judgement, machine)
    clean, _ = pipeline.compare_recording(sample[0], machine)
    left, good = (s.tracks[force.channel].values for s in (setting, clean))
    assert (np.abs(left - good) > 10.0 * noise).sum() <= 2  # bridged, not only counted
    beside = [f['detail'] for f in found['quality'] if f['kind'] == 'sensor_spikes']
    by_itself, counted = (int(detail.split()[0]) for (detail,) in (alone, beside))
    assert by_itself < 21  # what is small hides in the range of the force
    assert 22 <= counted <= 25
    assert abs(off_mm(found, truth, machine)) < 15.0


def a_second_of(recording):
    """Return the first second of a recording."""
    signals = {}
    for channel, s in recording.signals.items():
        n = 200
        signals[channel] = replace(
            s,
            stamp_ns=s.stamp_ns[:n],
            bag_ns=s.bag_ns[:n],
            values=s.values[:n],
            parts=s.parts[:n],
        )
    return replace(recording, signals=signals)


def test_a_second_of_signals_is_too_short(sample, machine):
    with pytest.raises(SynchronisationError, match='expected at least'):
        compared(a_second_of(sample[0]), machine)


@pytest.mark.issue(7)
def test_what_cannot_be_placed_is_known_before_anything_is_simulated(sample, machine, monkeypatch):
    recording, _ = sample
    monkeypatch.setattr(locate, 'simulate_loop', None)
    assert locate.checked(recording, machine) == recording.experiment
    with pytest.raises(SynchronisationError, match='expected at least'):
        locate.checked(a_second_of(recording), machine)
    with pytest.raises(RecordingError, match='no message on the experiment topic'):
        locate.checked(replace(recording, experiment=None), machine)


@pytest.mark.issue(7)
def test_of_several_recordings_one_without_a_place_ends_all_at_once(tmp_path, root, monkeypatch):
    # before a search: what it cost would be lost
    monkeypatch.setattr(campaign, 'look_together', None)
    text = (root / 'config' / 'machines' / 'prototype.yaml').as_posix()
    good = root / 'bags' / 'sample_clean'
    bad = tmp_path / 'bad.mcap'
    with bad.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    with pytest.raises(EscalatorError, match=r'bad\.mcap'):
        campaign.diagnose_together([str(good), str(bad)], text)


@pytest.mark.issue(6)
def test_no_reference_effect_makes_a_channel_of_odd_size(sample, machine):
    # what `score_of` takes for as seldom as an inverted sensor
    experiment = sample[0].experiment
    base = locate.simulate_loop(machine, experiment)
    effects = [
        Deviation('tensioner_friction', {'force_N': 150.0}),
        Deviation('tensioner_stiffness', {'factor': 1.4}),
        Deviation('tensioner_preload', {'factor': 0.8}),
        Deviation('rolling_resistance', {'factor': 0.6}),
        Deviation('drive_stiffness', {'factor': 0.25}),
        Deviation('landing_length', {'delta_m': 6e-3}, {'which': 'upper'}),
    ]
    for effect in effects:
        loop = locate.simulate_loop(apply(machine, (effect,)), experiment)
        for k, channel in enumerate(base.channels):
            n = min(len(loop.values), len(base.values))
            gain = np.polyfit(base.values[:n, k], loop.values[:n, k], 1)[0]
            if not channel.endswith('/y'):  # rattling alone
                assert 1.0 / GAIN < gain < GAIN, (effect.cause, channel)


def test_without_a_carriage_what_stands_beside_the_chain_tells_the_speed(root):
    """A gauge that rides on the chain leaves half a cycle of the pitch open, a torque at the gear nothing."""
    machine = load_machine(root / 'config' / 'machines' / 'kwon.yaml')
    speed, pitch = 0.4926, machine.chain.pitch_m
    time = np.arange(0.0, 25.0, 0.01)
    sensors = {s.quantity: s.channel for s in machine.instruments.sensors}
    travel = speed * time
    # its phase turns as it passes from one place of the loop to the next
    riding = np.sin(2.0 * np.pi * travel / pitch + 3.0 * np.sin(travel / 4.0))
    standing = np.sin(2.0 * np.pi * travel / pitch)
    tracks = {
        c: Timed(c, time, v, np.ones(len(time), bool), 100.0)
        for c, v in ((sensors['link_force'], riding), (sensors['gear_torque'], standing))
    }
    recording = Recording('', {}, Experiment(0.5, 1, (0.0,), 3000.0))
    found = locate._speed(tracks, machine, recording)
    assert found.value == pytest.approx(speed, rel=3e-4)
    assert found.high - found.low < 2e-3
