"""What one of several gauges alone shows is no part of the machine."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import lone
from escalator_twin.diagnosis.regression import fit

pytestmark = pytest.mark.issue(6)

CHANNELS = ('a', 'b', 'c', 'd', 'carriage')
WAVES = 400


def place_of(white, columns, channels=CHANNELS):
    """Return a comparison of noise of variance one, (waves, channels), beside nuisance, (waves, channels, q)."""
    sensors = [
        SimpleNamespace(channel=c, quantity='displacement' if c == 'carriage' else 'link_force')
        for c in channels
    ]
    machine = SimpleNamespace(instruments=SimpleNamespace(sensors=sensors))
    stage = SimpleNamespace(
        machine=machine,
        observation=SimpleNamespace(channels=channels),
        whiten=SimpleNamespace(temperature=1.0),
    )
    fitted = fit(white.reshape(-1), columns.reshape(white.size, -1))
    return SimpleNamespace(stage=stage, fitted=fitted)


@pytest.fixture
def judged(monkeypatch):
    """Return whether a remainder is one gauge's own, where a good machine leaves its noise."""
    monkeypatch.setattr(lone, 'levels_of', lambda place, _: np.ones(of(place)))
    monkeypatch.setattr(lone, 'limits_of', lambda place, *_: np.full(of(place), 1.4))

    def judge(place, is_open=True):
        monkeypatch.setattr(lone, 'is_open', lambda *_: is_open)
        return lone.is_in_one_gauge(place, None)

    return judge


def of(place):
    return len(place.stage.observation.channels)


def noise():
    return np.random.default_rng(5).standard_normal((WAVES, len(CHANNELS)))


def tolerance():
    """Return what a tolerance does: the same in all channels."""
    wave = 3.0 * np.sin(np.arange(WAVES))
    return np.repeat(wave[:, None], len(CHANNELS), 1)[:, :, None]


@pytest.mark.parametrize(
    ('channel', 'is_open', 'alone'),
    [('a', True, True), ('d', True, True), ('a', False, False), ('carriage', True, False)],
)
def test_what_one_gauge_alone_shows_is_its_own(judged, channel, is_open, alone):
    white = noise()
    white[:, CHANNELS.index(channel)] *= 4.0
    nothing = np.zeros((WAVES, len(CHANNELS), 1))
    assert judged(place_of(white, nothing), is_open) is alone


def test_a_tolerance_that_was_fitted_to_one_gauge_hides_nothing(judged):
    """What the gauge has it shares with the others, by a tolerance; without it they are good."""
    white, columns = noise(), tolerance()
    white[:, 0] += 9.0 * columns[:, 0, 0]
    place = place_of(white, columns)
    above = np.maximum(lone.by_channel(place) - 1.0, 0.0)
    assert above[0] < lone.IN_ONE * above.sum()
    assert judged(place)


@pytest.mark.parametrize('other', [1, 4])
def test_what_another_channel_shows_too_may_be_the_machine(judged, other):
    white, columns = noise(), tolerance()
    white[:, 0] += 9.0 * columns[:, 0, 0]
    white[:, other] += np.roll(columns[:, other, 0], 1) * 0.6  # no shape of the tolerance's
    assert not judged(place_of(white, columns))


def test_of_two_gauges_none_is_told_from_the_other(judged):
    white = noise()[:, :2]
    white[:, 0] *= 4.0
    assert not judged(place_of(white, np.zeros((WAVES, 2, 1)), ('a', 'b')))
