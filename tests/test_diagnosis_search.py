"""What the searches propose, and of how many places."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.fft import dct

from escalator_twin.diagnosis import search_rails, search_treads
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit, score_each
from escalator_twin.diagnosis.search import Search, search_all, WORTH
from escalator_twin.diagnosis.search_more import drive_waves
from escalator_twin.diagnosis.search_places import drags
from escalator_twin.diagnosis.whitening import Whitener

pytestmark = pytest.mark.issue(6)

AXLES, LENGTH_M, SAMPLES = 6, 6.0, 600
PITCH_M, SPEED_M_S, PITCHES = 0.405, 0.25, 60


def whiten(columns):
    """Return columns as they are, beside noise of 0.01."""
    return (100.0 * columns).reshape(-1, columns.shape[-1]).astype(np.float32)


def beside_noise(signal):
    """Return the fit of a signal without any nuisance."""
    white = whiten(signal[:, :, None])[:, 0]
    return fit(white, np.zeros((len(white), 0), np.float32), np.zeros(0))


def test_a_dragging_stretch_is_found_where_it_is_and_one_may_be_in_every_cell():
    rng = np.random.default_rng(3)
    change = rng.normal(size=(AXLES, SAMPLES, 2)).astype(np.float32)  # by one newton on an axle
    way = (np.arange(AXLES)[:, None] + 12.0 * np.arange(SAMPLES) / SAMPLES) % LENGTH_M
    inside = (way >= 2.5) & (way < 4.0)
    signal = 0.1 * np.sum(change * inside[:, :, None], axis=0)
    view = SimpleNamespace(
        n_links=AXLES,
        responses=SimpleNamespace(
            places={'roller_drag': 'any'}, base=SimpleNamespace(length_m=-LENGTH_M)
        ),
        place_of=lambda axle: way[axle],
        at=lambda *which: 0.5 * change[which[1]],
    )
    search = SimpleNamespace(
        view=view, model=np.zeros((SAMPLES, 2)), fitted=beside_noise(signal), whiten=whiten
    )
    found = list(drags(search))
    best = max(found, key=lambda p: p.gain)
    assert best.location == {'s_from_m': 2.5, 's_to_m': 4.0}
    assert best.parameters['force_N'] == pytest.approx(0.1, rel=1e-3)
    cells = 24
    assert {(p.places, p.draws) for p in found} == {(cells * (cells + 1) // 2, cells)}


@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
def test_a_wave_of_the_drive_is_found_and_a_good_drive_has_one(direction):
    frame = Frame(PITCH_M, 60, 41, SPEED_M_S)
    travel = np.arange(PITCHES * frame.per_pitch) * frame.spacing_m
    seconds = travel / SPEED_M_S
    turn = 2.0 * np.pi * travel / PITCH_M
    model = np.stack([np.sin(turn), np.cos(2.0 * turn)], axis=1)
    slope = np.stack([np.cos(turn), -2.0 * np.sin(2.0 * turn)], axis=1) * 2.0 * np.pi / PITCH_M
    omega, amplitude = 2.0 * np.pi * 0.4, 0.01
    # the way that a wave of the speed, v (1 + a cos w t), has moved the machine
    moved = SPEED_M_S * amplitude * np.sin(omega * seconds) / omega
    observation = SimpleNamespace(travel_m=travel, frame=frame, channels=('a', 'b'))
    sensor = SimpleNamespace(at={})
    experiment = SimpleNamespace(direction=direction)
    search = SimpleNamespace(
        view=SimpleNamespace(observation=observation),
        model=model,
        fitted=beside_noise(slope * moved[:, None]),
        whiten=whiten,
        machine=SimpleNamespace(instruments=SimpleNamespace(sensor=lambda _: sensor)),
        stage=SimpleNamespace(setting=SimpleNamespace(experiment=experiment)),
    )
    found = list(drive_waves(search))
    assert {p.draws for p in found} == {1}
    hunting = max((p for p in found if p.cause == 'drive_hunting'), key=lambda p: p.gain)
    assert hunting.parameters['frequency_hz'] == pytest.approx(0.4, abs=3e-3)
    assert hunting.parameters['relative_amplitude'] == pytest.approx(amplitude, rel=0.1)


def test_what_runs_the_twin_is_told_what_others_propose():
    told = []

    def cheap(search):
        told.append(search.least)
        yield Proposal('roller_drag', {}, {'force_N': 120.0}, 5_000.0)
        # a gauge's fault stands beside causes of the machine: it makes none of them hopeless
        yield Proposal('gauge_gain', {}, {'factor': 1.1}, 90_000.0)

    def costly(search):
        told.append(search.least)
        yield Proposal('roller_flat', {}, {'depth_m': 6e-4}, 7_000.0)

    search = Search(None, None, None, None)
    found = search_all(search, (cheap,), (costly,))
    assert [p.cause for p in found] == ['gauge_gain', 'roller_flat', 'roller_drag']
    assert told == [0.0, WORTH * 5_000.0]


@pytest.mark.parametrize(
    ('others', 'left', 'is_looked_for'),
    [
        (0.0, 1e4, True),
        (0.9, 1e4, True),
        (1.1, 1e4, False),
        (0.0, 201.0, True),
        (0.0, 199.0, False),
    ],
)
def test_a_spot_that_would_not_be_run_is_not_looked_for(monkeypatch, others, left, is_looked_for):
    # nor where the eccentricity explains more than a spot's first order could
    class LookedError(Exception):
        pass

    def look(*_):
        raise LookedError

    first = Proposal('roller_eccentricity', {'axle': 3}, {'amplitude_m': 1e-5}, 20.0)
    monkeypatch.setattr(search_treads, 'eccentric', lambda _: [first])
    monkeypatch.setattr(search_treads, 'turn_all', look)
    search = Search(
        None, SimpleNamespace(chi2=left), SimpleNamespace(machine=None, setting=SimpleNamespace(experiment=None),
        knobs=(), turned={}), None, least=others * 20.0 * search_treads.FLAT_MOST,
    )  # fmt: skip
    with pytest.raises(LookedError) if is_looked_for else nullcontext():
        assert not list(search_treads.flats(search))


def test_among_some_channels_a_candidate_explains_what_it_does_among_all():
    n, channels, q, some = 240, 5, 6, [1, 3]
    rng = np.random.default_rng(8)
    whiten = Whitener(
        np.ones((n, channels), np.float32), rng.uniform(0.5, 2.0, (150, channels)).astype(np.float32), 1.0
    )  # fmt: skip
    left = rng.normal(size=(n, channels, 1))
    nuisance = rng.normal(size=(n, channels, q))
    fitted = fit(whiten(left)[:, 0], whiten(nuisance), rng.normal(size=q))
    search = Search(None, fitted, SimpleNamespace(whiten=whiten), np.zeros((n, channels)))
    changes = np.zeros((n, channels, 3))
    changes[:, some] = rng.normal(size=(n, 2, 3))
    whole = score_each(fitted, whiten(changes))
    alone, whiten_alone = search.among(some)
    found = score_each(alone, whiten_alone(changes[:, some]))
    for one, other in ((found.size, whole.size), (found.gain, whole.gain), (found.sd, whole.sd)):
        assert one == pytest.approx(other, rel=1e-4)


def test_a_bump_bends_the_way_of_each_roller_where_it_passes(monkeypatch):
    # without the low-pass: the second derivative of the raised cosine, speed squared, a quarter of it
    length, speed = 20.0, 0.4
    way = np.array([0.01, 4.99, 5.0, 5.02, 5.04, 19.99])
    view = SimpleNamespace(
        observation=SimpleNamespace(frame=SimpleNamespace(speed_m_s=speed, rate_hz=50.0)),
        place_of=lambda axle: way + length * axle,
    )
    monkeypatch.setattr(search_rails, 'band_limited', lambda raw, _: raw)
    places = np.array([0.0, 5.0])
    wave = 2.0 * np.pi / search_rails.LENGTH_M

    def height(away):
        return np.where(
            np.abs(away) < 0.5 * search_rails.LENGTH_M, 0.5 * (1.0 + np.cos(wave * away)), 0.0
        )

    away = (way[:, None] - places + 0.5 * length) % length - 0.5 * length
    step = 1e-5
    bend = (height(away + step) - 2.0 * height(away) + height(away - step)) / step**2
    for axle in (0, 1):
        found = search_rails._bumps(SimpleNamespace(view=view), axle, places, length)
        assert found == pytest.approx(0.25 * speed**2 * bend, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize('precision', [np.float32, np.float64])
def test_waves_are_as_precise_as_the_mask_and_signals_stay_as_they_are(precision):
    # of a part of the samples a zero's column, a thousand times its signal, leaks into every wave
    n, channels = 240, 2
    signals = 1e3 * np.ones((n, channels, 1), np.float32)
    mask = np.ones((n, channels), precision)
    mask[50:120] = 0.0
    whiten = Whitener(mask, np.ones((150, channels), np.float32), 1.0)
    given = signals.copy()
    found = whiten(signals)
    assert found.dtype == precision
    assert np.array_equal(signals, given)
    truth = dct(mask.astype(np.float64) * 1e3, axis=0, norm='ortho')[:150]
    off = np.abs(found[:, 0].reshape(150, channels) - truth).max()
    assert off < (1e-9 if precision is np.float64 else 1e-2)
