"""Long bags and bags full of something else: read and checked in windows."""

from dataclasses import replace
import re

from makers import (
    changed,
    message,
    prototype,
    raw,
    START_NS,
    strain_messages,
    synthetic,
    with_signal,
    write_mcap,
)
from mcap.writer import CompressionType
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.bagfile import mcapfile, mcaprecords
from escalator_twin.check import check, document

pytestmark = pytest.mark.issue(5)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
NUMBER = re.compile(r'-?\d+(?:\.\d+)?(?:e[-+]\d+)?')
CAMERA = 'std_msgs/msg/String'


def experiment_message():
    values = {'set_speed': 0.5, 'direction': 1, 'load_per_step': 0.0, 'preload': 3000.0}
    made = message('escalator_msgs/msg/Experiment', case_id='long', machine='m', **values)
    return raw('/measured/experiment', 'escalator_msgs/msg/Experiment', START_NS, made)


def details(recording, kind):
    return [f.detail for f in recording.findings if f.kind == kind]


def faulty_messages(n):
    """Return strain messages, some of them repeated, exchanged or no numbers."""
    rows = strain_messages(n)
    for i in range(50, n - 1, 97):
        one, two = rows[i], rows[i + 1]
        rows[i], rows[i + 1] = (
            two._replace(bag_ns=one.bag_ns),
            one._replace(bag_ns=two.bag_ns),
        )
    repeated = [rows[i]._replace(bag_ns=rows[i].bag_ns + 1_000_000) for i in range(20, n, 110)]
    return sorted([*rows, *repeated], key=lambda row: row.bag_ns)


@pytest.mark.parametrize('options', [{'chunk_size': 2000}, {'use_chunking': False}], ids=str)
def test_a_window_is_a_slice_of_the_whole(tmp_path, options):
    rows = [experiment_message(), *faulty_messages(3000)]
    path = write_mcap(tmp_path / 'a.mcap', rows, **options)
    whole = bagfile.read(path, MACHINE)
    every = whole.signals[LEFT_A]
    bounds = START_NS + np.array([0, 3_003, 6_777, 10_001, 20_000]) * 1_000_000
    counts = {'duplicate': 0, 'out_of_order': 0}
    for from_ns, to_ns in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        part = bagfile.read(path, MACHINE, from_ns=from_ns, to_ns=to_ns)
        signal = part.signals[LEFT_A]
        inside = (every.bag_ns >= from_ns) & (every.bag_ns < to_ns)
        assert np.array_equal(signal.stamp_ns, every.stamp_ns[inside])
        assert np.array_equal(signal.parts, every.parts[inside])
        assert part.experiment == whole.experiment
        for kind in counts:
            counts[kind] += sum(int(text.split()[0]) for text in details(part, kind))
    for kind, n in counts.items():
        assert details(whole, kind)[0].split()[0] == str(n)


def test_chunks_outside_a_window_stay_packed(tmp_path, monkeypatch):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(6000), chunk_size=10_000)
    unpacked = []
    original = mcapfile.decompress

    def counting(data, compression, size):
        unpacked.append(size)
        return original(data, compression, size)

    monkeypatch.setattr(mcapfile, 'decompress', counting)
    bagfile.read(path, MACHINE)
    n_all = len(unpacked)
    unpacked.clear()
    at = START_NS + 15_000_000_000
    part = bagfile.read(path, MACHINE, from_ns=at, to_ns=at + 1_000_000_000)
    assert len(part.signals[LEFT_A].values) == 200
    # one second and two more on either side of thirty
    assert len(unpacked) < 0.25 * n_all


def test_an_empty_window_misses_everything(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', [experiment_message(), *strain_messages(20)])
    part = bagfile.read(path, MACHINE, from_ns=START_NS + 10**12)
    assert not part.signals
    assert part.experiment is not None
    assert part.experiment.case_id == 'long'


def test_the_bulk_of_an_unrelated_topic_is_never_read(tmp_path, monkeypatch):
    picture = message(CAMERA, data='x' * 50_000)
    bulk = [raw('/camera', CAMERA, START_NS + 5_000_000 * i, picture) for i in range(400)]
    path = tmp_path / 'a.mcap'
    # a recorder that caches by topic: chunks of one topic; uncompressed, so that bytes tell
    none = CompressionType.NONE
    rows = [experiment_message(), *strain_messages(400), *bulk]
    write_mcap(path, rows, chunk_size=60_000, compression=none)
    read = []
    original = mcaprecords.RecordFile.body

    def counting(self, start, length):
        data = original(self, start, length)
        read.append(len(data))
        return data

    monkeypatch.setattr(mcaprecords.RecordFile, 'body', counting)
    recording = bagfile.read(path, MACHINE)
    assert len(recording.signals[LEFT_A].values) == 400
    assert path.stat().st_size > 20_000_000
    assert sum(read) < 800_000


# check, window by window


def in_windows(monkeypatch, window_s):
    monkeypatch.setattr(document, 'LONG_S', window_s)
    monkeypatch.setattr(document, 'WINDOW_S', window_s)


def faulty(recording):
    """Return the recording with one fault of each kind, some of them across a window's edge."""
    rng = np.random.default_rng(4)
    outliers = rng.choice(np.arange(20, 19_900, 40), 40, replace=False)

    def put(channel, change):
        nonlocal recording
        parts = np.array(recording.signals[channel].parts)
        change(parts)
        recording = changed(recording, channel, parts=parts)

    def spike(parts):
        parts[outliers, 0] += 2.0

    def still(parts):
        parts[1950:2150] = parts[1950]  # 19.5 s to 21.5 s

    def hum(parts):
        time = np.arange(len(parts)) / 200.0
        parts += 6e-6 * 7.56e7 * np.sin(2 * np.pi * 50.0 * time)[:, None]

    put('step/acceleration/y', spike)
    put('tensioner/displacement', still)
    put('link_force/left_b', hum)
    put('link_force/right_b', lambda parts: parts.__setitem__((slice(None), 2), 907.2))
    for channel, missing in (
        (LEFT_A, [*range(3990, 4030), *range(9000, 9500), 12_000, 12_007]),
        ('link_force/right_a', [*range(11_000, 11_003)]),
    ):
        s = recording.signals[channel]
        kept = np.delete(np.arange(len(s.values)), missing)
        recording = changed(
            recording,
            channel,
            stamp_ns=s.stamp_ns[kept],
            bag_ns=s.bag_ns[kept],
            parts=s.parts[kept],
        )
    return recording


def same_document(windowed, whole):
    assert windowed['topics'] == [
        {**row, 'rate_hz': row['rate_hz'] and pytest.approx(row['rate_hz'], rel=1e-6)}
        for row in whole['topics']
    ]
    for key in ('schema', 'experiment', 'container', 'case_id'):
        assert windowed[key] == whole[key]
    for name, value in whole['clock'].items():
        if isinstance(value, float):
            assert windowed['clock'][name] == pytest.approx(value, rel=1e-3, abs=1e-6)
        else:
            assert windowed['clock'][name] in (value, list(value) if value else value)
    rows = [sorted(d['quality'], key=what) for d in (windowed, whole)]
    for one, other in zip(*rows, strict=True):
        assert what(one) == what(other)
        numbers = [[float(n) for n in NUMBER.findall(row['detail'])] for row in (one, other)]
        assert numbers[0] == pytest.approx(numbers[1], rel=5e-3)
        if one['repaired']:  # by reading: of the window where it was
            assert other['from_s'] - 0.01 <= one['from_s'] <= one['to_s'] <= other['to_s'] + 0.01
        else:
            assert one['from_s'] == pytest.approx(other['from_s'], abs=0.02)
            assert one['to_s'] == pytest.approx(other['to_s'], abs=0.02)


def what(row):
    return row['kind'], row['channel'], NUMBER.sub('#', row['detail'])


@pytest.mark.parametrize('with_faults', [False, True])
def test_windows_find_what_the_whole_shows(tmp_path, monkeypatch, with_faults):
    recording = synthetic(MACHINE, 100.0)
    if with_faults:
        recording = faulty(recording)
    bagfile.write(tmp_path / 'bag', recording, MACHINE, '/measured')
    whole = check(tmp_path / 'bag', MACHINE)
    kinds = {row['kind'] for row in whole['quality']}
    told = {'sensor_spikes', 'data_gap', 'mains_hum', 'gauge_dead'}
    assert kinds == (told if with_faults else set())
    in_windows(monkeypatch, 20.0)
    assert len(document.windows_of(bagfile.topics(tmp_path / 'bag'), MACHINE, 20.0, 20.0)) == 5
    same_document(check(tmp_path / 'bag', MACHINE), whole)


def test_windows_add_what_reading_mends(tmp_path, monkeypatch):
    path = write_mcap(tmp_path / 'a.mcap', [experiment_message(), *faulty_messages(3000)])
    whole = check(path, MACHINE)
    assert {'duplicate', 'out_of_order'} <= {row['kind'] for row in whole['quality']}
    in_windows(monkeypatch, 4.0)
    same_document(check(path, MACHINE), whole)


@pytest.mark.parametrize('step_s', [40, 5])
def test_a_step_of_a_loggers_clock_goes_through_all_windows(tmp_path, monkeypatch, step_s):
    recording = synthetic(MACHINE, 100.0)
    for sensor in MACHINE.instruments.sensors:
        if sensor.logger == 'on_board':
            s = recording.signals[sensor.channel]
            late = np.arange(len(s.values)) >= 0.31 * len(s.values)
            stamps = s.stamp_ns + late * step_s * 10**9
            recording = with_signal(recording, replace(s, stamp_ns=stamps))
    bagfile.write(tmp_path / 'bag', recording, MACHINE, '/measured')
    whole = check(tmp_path / 'bag', MACHINE)
    assert 'clock_disagreement' in {row['kind'] for row in whole['quality']}
    in_windows(monkeypatch, 20.0)
    same_document(check(tmp_path / 'bag', MACHINE), whole)
