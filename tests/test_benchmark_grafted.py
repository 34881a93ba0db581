"""A fault laid on another maker's recording changes what it says, and nothing else."""

from collections import Counter
import json
from pathlib import Path

import numpy as np
import pytest
from rig.bagfile import Recording, Series, write_bag
from rig.catalogue import draw_effect
from rig.faults import FAULTS
from rig.graft import graft
from rig.measured import read_recording

from benchmarks import grafted

pytestmark = pytest.mark.issue(6)

LINKS = ('left_a', 'left_b', 'right_a', 'right_b')
IMU, REFLEX = 'step/acceleration', 'tensioner/displacement'
SECONDS = 90.0


def series(name, kind, hz, width, rng):
    stamp = 10**15 + np.round(np.arange(0.0, SECONDS, 1.0 / hz) * 1e9).astype(np.int64)
    values = 1e-4 * rng.normal(size=(len(stamp), width))
    return Series(f'/measured/{name}', kind, name.split('/')[0], stamp, stamp + 4 * 10**6, values)


@pytest.fixture(scope='module')
def recording():
    rng = np.random.default_rng(5)
    rows = [
        series(f'link/{k}/strain', 'escalator_msgs/msg/LinkStrain', 200, 4, rng) for k in LINKS
    ]
    rows.append(series(IMU, 'sensor_msgs/msg/Imu', 200, 3, rng))
    rows.append(series(REFLEX, 'escalator_msgs/msg/TensionerDisplacement', 100, 1, rng))
    return Recording(10**15, 'toy', 0.5, 1, 75.0, 3000.0, tuple(rows))


def touched(effect):
    """Return the topics that an effect names, by contracts.md."""
    place = effect.location
    if effect.cause == 'clock_drift':
        return {*(f'link/{link}/strain' for link in LINKS), IMU}
    if effect.cause in ('axis_inverted', 'accelerometer_misalignment'):
        return {IMU}
    channels = [*place.get('channels', []), *([place['channel']] if 'channel' in place else [])]
    links = [*place.get('links', []), *([place['link']] if 'link' in place else [])]
    links += [c.split('/')[1] for c in channels if c.startswith('link_force/')]
    others = {c.rsplit('/', 1)[0] if c.startswith(IMU) else c for c in channels}
    return {f'link/{link}/strain' for link in links} | (others & {IMU, REFLEX})


@pytest.mark.parametrize('cause', FAULTS)
@pytest.mark.parametrize('seed', range(3))
def test_a_fault_changes_the_topics_that_it_names_and_no_other(recording, cause, seed):
    rng = np.random.default_rng([seed, 8])
    effect = draw_effect(rng, cause, 1.0)
    made = graft(recording, effect, rng)
    changed = {
        old.topic.removeprefix('/measured/')
        for old, new in zip(recording.series, made.series, strict=True)
        if len(new.values) != len(old.values)
        or not np.array_equal(new.values, old.values)
        or not np.array_equal(new.stamp_ns, old.stamp_ns)
    }
    assert changed == touched(effect)


def test_sizes_are_the_contracts(recording):
    def laid(cause, **numbers):
        effect = draw_effect(np.random.default_rng(0), cause, 1.0)
        effect.location.update(numbers.pop('place', {}))
        effect.parameters.update(numbers)
        made = graft(recording, effect, np.random.default_rng(0))
        return {s.topic.removeprefix('/measured/'): s for s in made.series}

    before = {s.topic.removeprefix('/measured/'): s for s in recording.series}
    gain = laid('gauge_gain', place={'link': 'left_b'}, factor=1.09)['link/left_b/strain']
    assert np.allclose(gain.values, 1.09 * before['link/left_b/strain'].values)
    clock = laid('clock_drift', ppm=900.0)[IMU].stamp_ns
    late = (clock - before[IMU].stamp_ns)[-1] * 1e-9
    assert late == pytest.approx(900e-6 * (SECONDS - 1.0 / 200), rel=1e-6)
    turned = laid('accelerometer_misalignment', x_deg=0.0, y_deg=0.0, z_deg=4.0)[IMU].values
    # seen from a sensor that is turned to the left, what is ahead lies to the right
    angles = np.angle(turned @ [1, 1j, 0]) - np.angle(before[IMU].values @ [1, 1j, 0])
    assert np.allclose(np.rad2deg((angles + np.pi) % (2 * np.pi) - np.pi), -4.0)


def test_what_is_written_is_what_was_read(recording, tmp_path):
    short = Recording(
        *(getattr(recording, f) for f in ('start_ns', 'case_id', 'set_speed_m_s', 'direction')),
        recording.load_kg,
        recording.preload_n,
        tuple(
            Series(s.topic, s.msgtype, s.frame, s.stamp_ns[:50], s.bag_ns[:50], s.values[:50])
            for s in recording.series
        ),
    )
    write_bag(short, tmp_path / 'bag')
    again = read_recording(tmp_path / 'bag')
    assert (again.case_id, again.direction, again.load_kg) == ('toy', 1, 75.0)
    old = {s.topic: s for s in short.series}
    for s in again.series:
        assert np.array_equal(s.values, old[s.topic].values)
        assert np.array_equal(s.stamp_ns, old[s.topic].stamp_ns)
        assert np.array_equal(s.bag_ns, old[s.topic].bag_ns)
        assert s.frame == old[s.topic].frame


def test_faults_are_drawn_evenly_and_a_name_tells_nothing(monkeypatch, tmp_path, recording):
    bags = [Path(f'bag_{k}') for k in range(7)]
    pairs = grafted.draw_grafts(bags, 3, ['a', 'b', 'c'], seed=4)
    assert Counter(bag for bag, _ in pairs) == dict.fromkeys(bags, 3)
    assert set(Counter(cause for _, cause in pairs).values()) == {7}
    assert pairs == grafted.draw_grafts(bags, 3, ['a', 'b', 'c'], seed=4)
    assert pairs != grafted.draw_grafts(bags, 3, ['a', 'b', 'c'], seed=5)
    monkeypatch.setattr(grafted, 'read_recording', lambda _: recording)
    written = []
    monkeypatch.setattr(grafted, 'write_bag', lambda _, path: written.append(path.name))
    labels = {'bag_0': [{'cause': 'roller_drag'}]}
    grafted.write_grafts([(bags[0], 'mains_hum')], labels, 'reference', 4, tmp_path / 'out')
    assert written == ['machine_000_0']
    truth = json.loads((tmp_path / 'out/truth/machine_000_0.json').read_text())
    assert [effect['cause'] for effect in truth['effects']] == ['roller_drag', 'mains_hum']
