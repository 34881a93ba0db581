"""What a comparison repairs before it judges, and what it leaves as it is."""

from makers import changed, prototype, synthetic
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.check import quality
from escalator_twin.check.gaps import STILL
from escalator_twin.check.spikes import outliers
from escalator_twin.comparison.mend import axial_weights, mend

pytestmark = pytest.mark.issue(5)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
Z = 'step/acceleration/z'
EA = 7.56e7


def mended(recording):
    """Return the repaired recording and the kinds of findings, told whether repaired."""
    repaired, findings = mend(recording, MACHINE, quality(recording, MACHINE))
    return repaired, {(f.kind, f.channel, f.repaired) for f in findings}


def with_spikes(recording, channel, size, n=20):
    """Return the recording with outliers in all parts of a channel, and where they are."""
    signal = recording.signals[channel]
    rng = np.random.default_rng(8)
    where = 40 * rng.permutation(np.arange(1, len(signal.values) // 40 - 1))[:n]
    parts = np.array(signal.parts)
    parts[where] += size * rng.choice([-1.0, 1.0], n)[:, None]
    return changed(recording, channel, parts=parts), where


@pytest.mark.parametrize('name', ['sample_clean', 'sample_guide_step'])
def test_outliers_are_bridged_and_impacts_stay(root, name):
    clean = bagfile.read(root / 'bags' / name, MACHINE)
    spiked, where = with_spikes(clean, Z, 5.0)
    repaired, kinds = mended(spiked)
    assert ('sensor_spikes', Z, True) in kinds
    before, after = clean.signals[Z].values, repaired.signals[Z].values
    moved = np.flatnonzero(after != spiked.signals[Z].values)
    assert len(set(where) & set(moved)) >= 17
    # among 15 000 and more samples, rattling rollers look like outliers a few times
    assert len(set(moved) - set(where)) <= 8
    # a straight line between its neighbours is as good as the sample's own noise
    assert np.median(np.abs(after[where] - before[where])) < 0.05


def test_what_is_mended_is_what_check_names():
    spiked, where = with_spikes(synthetic(MACHINE, 60.0), Z, 1.0)
    (finding,) = (f for f in quality(spiked, MACHINE) if f.kind == 'sensor_spikes')
    signals, sensor = spiked.signals, MACHINE.instruments.sensor
    others = [(signals[f'step/acceleration/{a}'], sensor(f'step/acceleration/{a}')) for a in 'xy']
    mask = outliers(signals[Z], sensor(Z), others)
    assert int(finding.detail.split()[0]) == mask.any(axis=0).sum() == len(where)
    assert set(np.flatnonzero(mask.any(axis=0))) == set(where)


def test_a_clean_recording_is_left_alone():
    clean = synthetic(MACHINE, 60.0)
    assert mend(clean, MACHINE, quality(clean, MACHINE))[0] is clean


def test_a_dead_gauge_stays_mended_beside_outliers():
    clean = synthetic(MACHINE, 60.0)
    parts = np.array(clean.signals[LEFT_A].parts)
    parts[:, 2] = parts[0, 2]
    parts[[500, 3000, 7000], 3] += 20e-6 * EA
    broken = changed(clean, LEFT_A, parts=parts)
    repaired, kinds = mended(broken)
    assert {('gauge_dead', LEFT_A, True), ('sensor_spikes', LEFT_A, True)} <= kinds
    off = repaired.signals[LEFT_A].values - clean.signals[LEFT_A].values
    assert np.std(off) < 0.05 * np.std(clean.signals[LEFT_A].values)


def gauges(rng, n=400, crooked=0.025):
    """Return axial strain (n,) and what four gauges make of it: both bendings, no noise."""
    axial, bent = rng.normal(size=n), 0.3 * rng.normal(size=n)
    faces = 1.0 + crooked * np.array([1.0, 1.0, -1.0, -1.0])
    return axial, axial[:, None] * faces + bent[:, None] * np.array([1.0, -1.0, 1.0, -1.0])


# of four gauges, by hand: three tell axial part and both bendings in one way alone (1 + 4 or 2 + 3)
@pytest.mark.issue(6)
@pytest.mark.parametrize(
    ('dead', 'noise', 'exact'),
    [((), 1.0, True), *(((k,), 2.0**0.5, True) for k in range(4)), ((0, 3), 2.0**0.5, True),
     ((0, 1), 2.0**0.5, False)],
)  # fmt: skip
def test_the_living_gauges_tell_the_axial_part(dead, noise, exact):
    axial, parts = gauges(np.random.default_rng(3))
    live = ~np.isin(np.arange(4), dead)
    weights = axial_weights(MACHINE.instruments.sensor(LEFT_A), live)
    found = parts[:, live] @ weights
    assert np.allclose(found, axial, atol=1e-9) is exact  # with one face alone it reads 2.5 % more
    assert np.allclose(found, axial, rtol=0.05, atol=0.05)
    assert (4.0 * weights @ weights) ** 0.5 == pytest.approx(noise)


@pytest.mark.parametrize('dead', [(0, 2), (0, 1, 2)])
def test_one_edge_alone_is_not_mended(dead):
    live = ~np.isin(np.arange(4), dead)
    assert axial_weights(MACHINE.instruments.sensor(LEFT_A), live) is None


@pytest.mark.issue(6)
def test_what_living_gauges_tell_is_noisier_and_that_is_told(root):
    recording = bagfile.read(root / 'bags' / 'sample_clean', MACHINE)
    parts = np.array(recording.signals[LEFT_A].parts)
    parts[:, 1] = parts[0, 1]
    broken = changed(recording, LEFT_A, parts=parts)
    repaired, findings = mend(broken, MACHINE, quality(broken, MACHINE))
    (noise,) = [f.noise for f in findings if f.kind == 'gauge_dead']
    assert noise == pytest.approx(2.0**0.5)
    # against all four it has a quarter of each gauge's noise of 0.25 microstrain more or less; they creep apart
    off = repaired.signals[LEFT_A].values - recording.signals[LEFT_A].values
    assert np.std(np.diff(off)) / 2.0**0.5 == pytest.approx(0.125e-6 * EA, rel=0.1)


def test_what_stands_still_becomes_a_gap():
    """A logger that repeats its last value while the gauges' telemetry is away has nothing of the machine."""
    recording = synthetic(MACHINE, 60.0)
    parts = np.array(recording.signals[LEFT_A].parts)
    parts[4000:5000] = parts[4000]
    repaired, kinds = mended(changed(recording, LEFT_A, parts=parts))
    assert ('data_gap', LEFT_A, True) in kinds
    before, after = recording.signals[LEFT_A], repaired.signals[LEFT_A]
    lost = np.setdiff1d(before.stamp_ns, after.stamp_ns)
    assert lost == pytest.approx(before.stamp_ns[4000:5000])
    kept = np.isin(before.stamp_ns, after.stamp_ns)
    assert np.array_equal(after.values, parts.mean(axis=1)[kept])


def test_a_channel_that_dies_is_as_long_as_it_was_recorded():
    recording = synthetic(MACHINE, 60.0)
    parts = np.array(recording.signals[LEFT_A].parts)
    parts[4000:] = parts[4000]
    repaired, _ = mended(changed(recording, LEFT_A, parts=parts))
    before, after = (r.signals[LEFT_A].stamp_ns for r in (recording, repaired))
    assert np.array_equal(after, np.r_[before[:4000], before[-1]])


def test_a_channel_that_never_moves_is_none():
    recording = synthetic(MACHINE, 60.0)
    signal = recording.signals[LEFT_A]
    flat = np.zeros_like(signal.parts)
    repaired, kinds = mended(changed(recording, LEFT_A, parts=flat))
    assert ('data_gap', LEFT_A, True) in kinds
    assert set(repaired.signals) == set(recording.signals) - {LEFT_A}


def test_a_gap_is_not_told_as_repaired_since_its_channel_stood_still_elsewhere():
    recording = synthetic(MACHINE, 60.0)
    signal = recording.signals[LEFT_A]
    parts = np.array(signal.parts)
    parts[4000:5000] = parts[4000]
    there = np.r_[0:6000, 7000 : len(parts)]
    columns = {name: getattr(signal, name)[there] for name in ('stamp_ns', 'bag_ns')}
    parts = parts[there]
    broken = changed(recording, LEFT_A, parts=parts, **columns)
    told = [f for f in mend(broken, MACHINE, quality(broken, MACHINE))[1] if f.kind == 'data_gap']
    assert {f.detail.startswith(STILL): f.repaired for f in told} == {True: True, False: False}
