"""Long bags and bags full of something else: read in windows, in bounded memory."""

from makers import message, prototype, raw, START_NS, strain_messages, write_mcap
from mcap.writer import CompressionType
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.bagfile import mcapfile, mcaprecords

pytestmark = pytest.mark.issue(5)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
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
