"""A bouncing frame is fitted on from other frequencies, along which all else is fitted."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import frequencies
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.errors import ExperimentError

pytestmark = pytest.mark.issue(6)

CONTEXT = SimpleNamespace(floor=None)
NUMBERS = ('modal_mass_kg', 'frequency_hz', 'damping_ratio')
OPEN = 9000.0


def two_hollows(hz):
    """Return chi squared: a hollow at 7.15 Hz, a shallower one at 7.55, and walls beyond."""
    deep, shallow = 1e6 * (hz / 7.15 - 1.0) ** 2, 120.0 + 1e6 * (hz / 7.55 - 1.0) ** 2
    return 1000.0 + min(deep, shallow, 600.0 + 1e4 * abs(hz / 7.35 - 1.0))


def place_of(chi2, left=10.0):
    return SimpleNamespace(
        left=left,
        fitted=chi2,
        model=None,
        stage=SimpleNamespace(judged=lambda fitted, _: fitted, turned={}),
    )


def tried_at(hz, cause='truss_resonance', left=10.0, is_polished=True, law=two_hollows):
    frame = Proposal(
        cause, {}, dict(zip(NUMBERS, (4500.0, hz, 0.02), strict=True)), 1.0, fitted=NUMBERS
    )
    fit = Polished(CONTEXT, place_of(law(hz), left), (frame,), ({},)) if is_polished else None
    return Tried(frame, OPEN - law(hz), {}, fit)


def walked_from(monkeypatch, one, law=two_hollows, known=(), fails_above=99.0):
    """Return what the walk leads to; a fit goes down in its hollow where the frequency is free."""
    asked = []

    def fit(context, effects, *_, is_near=False, **__):
        assert is_near
        assert context is CONTEXT
        *_, frame = effects
        hz = frame.parameters['frequency_hz']
        if hz > fails_above:
            raise ExperimentError('the machine cannot be run')
        is_free = 'frequency_hz' in frame.fitted
        asked.append((hz, is_free))
        if is_free:
            around = hz * np.linspace(0.98, 1.02, 401)
            hz = float(around[np.argmin([law(f) for f in around])])
            frame = Proposal(
                frame.cause, {}, {**frame.parameters, 'frequency_hz': hz}, 1.0, fitted=NUMBERS
            )
        return Polished(context, place_of(law(hz)), (frame,), ({'frequency_hz': 0.01},))

    monkeypatch.setattr(frequencies, 'polish', fit)
    monkeypatch.setattr(frequencies, 'excess_of', lambda place, _: place.left)
    found = frequencies.from_other_frequencies(CONTEXT, place_of(OPEN, 1e3), known, one, 2)
    return found, asked


def test_a_frame_in_the_shallower_hollow_is_led_to_the_deeper_one(monkeypatch):
    found, asked = walked_from(monkeypatch, tried_at(7.55))
    assert found.proposal.parameters['frequency_hz'] == pytest.approx(7.15, rel=2e-3)
    assert found.proposal.fitted == NUMBERS
    assert found.gain == pytest.approx(OPEN - 1000.0, abs=5.0)
    assert found.polished.effects[-1] is found.proposal
    # on the way all but the frequency is fitted; freely from the farthest that may do
    assert sum(is_free for _, is_free in asked) == 1


def test_a_deeper_hollow_on_the_way_to_the_farthest_is_not_passed_by(monkeypatch):
    """Beyond the hollow at 7.35 Hz there is a plain, as high as where the walk begins."""

    def law(hz):
        return 1000.0 - max(0.0, 500.0 - 4e6 * (hz / 7.35 - 1.0) ** 2) + 900.0 * (hz < 6.9)

    found, asked = walked_from(monkeypatch, tried_at(7.0), law)
    assert found.proposal.parameters['frequency_hz'] == pytest.approx(7.35, rel=2e-3)
    assert found.gain == pytest.approx(OPEN - 500.0, abs=5.0)
    assert max(hz for hz, _ in asked) > 8.0
    # freely from there, and from the farthest to either side
    assert sum(is_free for _, is_free in asked) <= 3


def test_a_frame_in_the_deeper_one_stays_and_its_reach_holds_the_other(monkeypatch):
    own = tried_at(7.15)
    found, _ = walked_from(monkeypatch, own, lambda hz: two_hollows(hz) - 60.0 * (hz > 7.3))
    assert found.proposal is own.proposal
    low, high = found.near
    assert low <= 7.15
    assert high == pytest.approx(7.55, abs=0.1)


def test_the_walk_ends_where_two_in_succession_are_lost(monkeypatch):
    found, asked = walked_from(
        monkeypatch, tried_at(7.15), lambda hz: 1000.0 + 5e6 * (hz / 7.15 - 1.0) ** 2
    )
    assert len(asked) == 4
    assert found.near == (7.15, 7.15)


def test_frequencies_at_which_the_machine_cannot_run_are_none(monkeypatch):
    found, asked = walked_from(monkeypatch, tried_at(7.15), fails_above=7.2)
    assert found.near[1] == 7.15
    assert all(hz <= 7.2 for hz, _ in asked)


@pytest.mark.parametrize(
    ('one', 'known'),
    [
        (tried_at(7.55, left=300.0), ()),
        (tried_at(7.55, cause='drive_stiffness'), ()),
        (tried_at(7.55, is_polished=False), ()),
        (tried_at(7.55), (Proposal('roller_flat', {}, {'depth_m': 6e-4}, 1.0),)),
    ],
    ids=['explains little', 'no frame', 'not fitted', 'beside a roller'],
)
def test_no_walk_is_made(monkeypatch, one, known):
    found, asked = walked_from(monkeypatch, one, known=known)
    assert found is one
    assert asked == []
