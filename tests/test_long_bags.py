"""Long bags and bags full of something else: read in windows, in bounded memory."""

from dataclasses import replace
import json
import re
import struct
import subprocess
import sys

from makers import (
    changed,
    definition,
    message,
    PROTOTYPE,
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
import zstandard

from escalator_twin import bagfile, pipeline
from escalator_twin.bagfile import mcapfile, mcaprecords, writing
from escalator_twin.bagfile.cdr import walk
from escalator_twin.check import check, document
from escalator_twin.comparison import parts
from escalator_twin.conversions import STAMP
from escalator_twin.instruments import record
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation, run_twin

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


# comparison, part by part


def part_document(speed, findings=(), **scores):
    return {
        'path': 'a',
        'start_s_m': 1.0,
        'speed_m_s': {'value': speed, 'low': speed - 3e-4, 'high': speed + 4e-4},
        'place_is_certain': True,
        'clock': {'offset_s': 0.5},
        'channels': {LEFT_A: {'r_time': 0.5, 'nrmse': 0.5, 'ceiling_r_time': None, **scores}},
        'sides': {'link a': {'share': 0.5 + speed}},
        'sensor_pose': {},
        'quality': [
            dict(zip(('kind', 'channel', 'from_s', 'to_s', 'detail'), f, strict=True))
            for f in findings
        ],
        'overlay': {'of': speed},
    }


def test_parts_pool_what_can_be_pooled():
    rng = np.random.default_rng(2)
    m = rng.standard_normal(3000).cumsum()
    s = m + rng.standard_normal(3000)
    halves = [slice(0, 1000), slice(1000, 3000)]
    sums = []
    for half in halves:
        a, b = (row[half] - row[half].mean() for row in (m, s))
        m[half], s[half] = a, b
        pair = np.array([a @ a, b @ b, a @ b, len(a)])
        sums.append({LEFT_A: dict.fromkeys(set(parts.CORRELATIONS.values()), pair)})
    order = [[{'phase_deg': v, 'coherence': None}] for v in (179.0, -178.0)]
    documents = [
        part_document(0.5, r_freq=0.9, orders=order[0]),
        part_document(0.6, r_freq=0.6, orders=order[1]),
    ]
    merged = parts.merge_parts(documents, sums, [(0.0, 300.0), (300.0, 900.0)])
    scores = merged['channels'][LEFT_A]
    assert scores['r_time'] == pytest.approx(np.corrcoef(m, s)[0, 1])
    assert scores['nrmse'] == pytest.approx(np.std(m - s) / np.std(m))
    assert scores['ceiling_r_time'] is None
    assert scores['r_freq'] == pytest.approx(0.7)
    assert abs(scores['orders'][0]['phase_deg']) == pytest.approx(179.0, abs=0.01)
    assert scores['orders'][0]['coherence'] is None
    assert merged['speed_m_s']['value'] == pytest.approx(0.5 + 0.2 / 3)
    assert 0.0 < merged['speed_m_s']['value'] - merged['speed_m_s']['low'] < 3e-4
    assert merged['sides']['link a']['share'] == pytest.approx(0.5 + merged['speed_m_s']['value'])
    assert merged['overlay'] == {'of': 0.5}
    assert merged['parts']['n'] == 2
    assert 'r_time' in merged['parts']['pooled']
    assert 'r_freq' in merged['parts']['averaged']


def test_findings_of_parts_are_in_the_time_of_the_recording():
    gap = ('data_gap', LEFT_A, 3.0, 7.0, '800 samples missing')
    clock = ('clock_drift', '', 0.0, 0.0, 'too fast')
    documents = [part_document(0.5, [gap, clock]), part_document(0.5, [gap, clock])]
    sums = [{LEFT_A: dict.fromkeys(set(parts.CORRELATIONS.values()), np.ones(4))}] * 2
    found = parts.merge_parts(documents, sums, [(0.0, 600.0), (600.0, 900.0)])['quality']
    assert [(row['kind'], row['from_s']) for row in found] == [
        ('data_gap', 3.0),
        ('clock_drift', 0.0),
        ('data_gap', 603.0),
    ]


@pytest.mark.slow
@pytest.mark.shared
def test_parts_agree_with_the_whole(shared, monkeypatch):
    path = str(shared / 'measured' / 'campaign' / 'case_01_low_up_empty_lo')
    whole = pipeline.compare_bag(path, PROTOTYPE)
    monkeypatch.setattr(parts, 'LONG_S', 60.0)
    monkeypatch.setattr(parts, 'PART_S', 90.0)
    merged = pipeline.compare_bag(path, PROTOTYPE)
    assert merged['parts']['n'] == 2
    assert merged['speed_m_s']['value'] == pytest.approx(whole['speed_m_s']['value'], rel=1e-3)
    assert merged['start_s_m'] == pytest.approx(whole['start_s_m'], abs=0.015)
    for channel in ('link_force/left_a', 'tensioner/displacement', 'step/acceleration/z'):
        one, other = (d['channels'][channel] for d in (merged, whole))
        assert one['r_time'] == pytest.approx(other['r_time'], abs=2e-3)
        assert one['nrmse'] == pytest.approx(other['nrmse'], abs=0.02)


# memory


def frames(rows, channel, bag_ns):
    """Return MCAP message records, (n, 31 + size) bytes, as numpy writes them."""
    n, size = rows.shape
    made = np.zeros((n, 31 + size), np.uint8)
    made[:, 0] = 5
    for at, values, kind in (
        (1, np.full(n, 22 + size), '<u8'),
        (9, np.full(n, channel), '<u2'),
        (15, bag_ns, '<u8'),
        (23, bag_ns, '<u8'),
    ):
        cells = np.ascontiguousarray(values.astype(kind)[:, None]).view(np.uint8)
        made[:, at : at + cells.shape[1]] = cells
    made[:, 31:] = rows
    return made


def framed(opcode, body):
    return bytes([opcode]) + struct.pack('<Q', len(body)) + body


def text(value):
    data = value.encode()
    return struct.pack('<I', len(data)) + data


class LongWriter:
    """A cheap writer of chunks: no summary, but the message indices that a recorder writes."""

    def __init__(self, path):
        self.file = path.open('wb')
        self.file.write(mcaprecords.MAGIC + framed(1, text('ros2') + text('made')))

    def channel(self, number, topic, kind):
        schema = struct.pack('<H', number) + text(kind) + text('ros2msg') + text(definition(kind))
        self.file.write(framed(3, schema))
        self.file.write(
            framed(4, struct.pack('<HH', number, number) + text(topic) + text('cdr') + bytes(4))
        )

    def head(self, first_ns, last_ns, size, compression, stored):
        head = struct.pack('<QQQI', first_ns, last_ns, size, 0)
        head += text(compression) + struct.pack('<Q', stored)
        self.file.write(bytes([6]) + struct.pack('<Q', len(head) + stored) + head)

    def index(self, number, bag_ns, at):
        entries = np.column_stack([bag_ns, at]).astype('<u8').tobytes()
        self.file.write(framed(7, struct.pack('<HI', number, len(entries)) + entries))

    def chunk(self, topics):
        """Write a chunk of (channel, bag times, rows)."""
        parts_, indices, position = [], [], 0
        for number, bag_ns, rows in topics:
            made = frames(rows, number, bag_ns)
            indices.append((number, bag_ns, position + np.arange(len(made)) * made.shape[1]))
            parts_.append(made.tobytes())
            position += made.size
        data = zstandard.ZstdCompressor(level=1).compress(b''.join(parts_))
        first = min(int(bag_ns.min()) for _, bag_ns, _ in topics)
        last = max(int(bag_ns.max()) for _, bag_ns, _ in topics)
        self.head(first, last, position, 'zstd', len(data))
        self.file.write(data)
        for index in indices:
            self.index(*index)

    def hole(self, number, bag_ns, size):
        """Write a chunk that is a hole in the file: whoever reads it finds no message."""
        self.head(bag_ns, bag_ns, size, '', size)
        self.file.seek(size, 1)
        self.index(number, np.array([bag_ns]), np.array([0]))

    def close(self):
        self.file.write(framed(15, bytes(4)) + framed(2, bytes(20)) + mcaprecords.MAGIC)
        self.file.close()


BLOCK_S = 60


def long_bag(path, duration_s, hole_bytes=0, minute=None):
    """Write the instruments' messages, the same minute again and again; return how many."""
    minute = minute or synthetic(MACHINE, float(BLOCK_S))
    streams = writing._streams(minute, MACHINE, '/measured')
    types = writing.typestore_for({s.type for s in streams}).fielddefs
    writer = LongWriter(path)
    for i, stream in enumerate(streams):
        writer.channel(i + 1, stream.topic, stream.type)
    writer.channel(99, '/camera', CAMERA)
    total = 0
    for k in range(duration_s // BLOCK_S):
        for part in range(6):
            topics_ = []
            for i, stream in enumerate(streams):
                n = len(stream.rows)
                if n == 1 and (k or part):
                    continue
                rows = np.array(stream.rows[part * n // 6 : (part + 1) * n // 6 or None])
                if n == 1:
                    rows = np.array(stream.rows)
                bag_ns = stream.bag_ns[part * n // 6 : part * n // 6 + len(rows)]
                place = walk(rows[0].tobytes(), stream.type, types, set(STAMP)).places[STAMP[0]]
                cells = rows[:, place.offset : place.offset + 4]
                seconds = np.ascontiguousarray(cells).view('<i4') + BLOCK_S * k
                rows[:, place.offset : place.offset + 4] = seconds.astype('<i4').view(np.uint8)
                topics_.append((i + 1, bag_ns + BLOCK_S * k * 10**9, rows))
                total += len(rows)
            writer.chunk(topics_)
            if hole_bytes:
                writer.hole(99, int(topics_[-1][1][-1]), hole_bytes)
    writer.close()
    return total


def round_once():
    """Return a minute in which the twin goes round exactly once, so that it can be repeated."""
    loggers = {
        name: replace(logger, drift_ppm=0.0)
        for name, logger in MACHINE.instruments.loggers.items()
    }
    sensors = tuple(replace(s, thermal_drift=0.0) for s in MACHINE.instruments.sensors)
    instruments = replace(MACHINE.instruments, loggers=loggers, sensors=sensors)
    machine = replace(MACHINE, instruments=instruments)
    chain = machine.chain
    experiment = Experiment(
        chain.n_links * chain.pitch_m / BLOCK_S, 1, (75.0,), 6000.0, machine=machine.name
    )
    simulation = make_simulation(machine, experiment)
    trace = run_twin(simulation, sensors, 3.0, float(BLOCK_S), 200.0)
    return record(trace, machine, experiment, seed=3)


MEASURE = """
import json, re, sys
from pathlib import Path
from escalator_twin.check import check
from escalator_twin.machine import load_machine
from escalator_twin.pipeline import compare_bag
if sys.argv[3] == 'check':
    document = check(sys.argv[1], load_machine(sys.argv[2]))
else:
    document = compare_bag(sys.argv[1], sys.argv[2])
    del document['overlay']
status = Path('/proc/self/status').read_text()
peak = int(re.search(r'VmHWM:\\s+(\\d+) kB', status)[1]) / 1024
print(json.dumps({'peak_mb': peak, 'document': document}, default=float))
"""


def measured(path, verb='check'):
    """Run a verb in a process of its own; return its peak in MB and its document."""
    command = [sys.executable, '-c', MEASURE, str(path), str(PROTOTYPE), verb]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    result = json.loads(done.stdout)
    return result['peak_mb'], result['document']


@pytest.mark.slow
def test_two_hours_take_no_more_memory_than_ten_minutes(tmp_path):
    peaks = {}
    for name, duration_s in (('short', 600), ('long', 7200)):
        path = tmp_path / f'{name}.mcap'
        total = long_bag(path, duration_s)
        assert total == pytest.approx(1100 * duration_s, rel=1e-3)
        peaks[name], document = measured(path)
        path.unlink()
        assert sum(row['n_messages'] for row in document['topics']) == total
        assert document['clock']['offset_s'] is not None
        assert not {row['kind'] for row in document['quality']} & {'data_gap', 'rate', 'jitter'}
    print(peaks)
    assert peaks['long'] < 500.0
    assert peaks['long'] < 1.1 * peaks['short']


@pytest.mark.long
@pytest.mark.slow
def test_two_hours_are_compared_in_no_more_memory_than_ten_minutes(tmp_path):
    minute, peaks = round_once(), {}
    for name, duration_s in (('short', 600), ('long', 7200)):
        path = tmp_path / f'{name}.mcap'
        long_bag(path, duration_s, minute=minute)
        peaks[name], document = measured(path, 'compare')
        path.unlink()
        assert document['speed_m_s']['value'] == pytest.approx(0.405, rel=1e-3)
        assert document['start_s_m'] == pytest.approx(3.0, abs=0.015)
        assert document['channels'][LEFT_A]['r_time'] > 0.999
    assert document['parts']['n'] == 16
    print(peaks)
    assert peaks['long'] < 500.0
    assert peaks['long'] < 1.1 * peaks['short']


@pytest.mark.slow
def test_four_gigabytes_of_another_topic_are_skipped(tmp_path):
    plain, bulky = tmp_path / 'plain.mcap', tmp_path / 'bulky.mcap'
    long_bag(plain, 600)
    long_bag(bulky, 600, hole_bytes=72_000_000)
    assert bulky.stat().st_size > 4 * 2**30
    peak, document = measured(plain)
    bulk_peak, with_bulk = measured(bulky)
    print(peak, bulk_peak)
    assert with_bulk['quality'] == document['quality']
    assert with_bulk['container']['losses'] == []
    assert bulk_peak < 1.1 * peak
    assert bulk_peak < 500.0
