"""Whether what was fitted leaves more of a recording than a good machine does."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import closing
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried

pytestmark = pytest.mark.issue(7)

ROLLING = Proposal('rolling_resistance', {}, {'factor': 0.74}, 500.0)
LANDING = Proposal('landing_length', {'which': 'upper'}, {'delta_m': -3.6e-3}, 18.0)


@pytest.mark.parametrize(
    ('cause', 'is_open', 'is_closed'),
    [('roller_drag', False, True), ('roller_drag', True, False), ('guide_step', False, False)],
)
def test_an_effect_of_one_axle_that_leaves_nothing_needs_no_rival_from_afar(
    monkeypatch, cause, is_open, is_closed
):
    monkeypatch.setattr(closing, 'is_open', lambda *_: is_open)
    fit = SimpleNamespace(place=None)
    first = Tried(Proposal(cause, {}, {}, 900.0), 900.0, {}, fit)
    second = Tried(Proposal('guide_step', {}, {}, 30.0), 30.0, {}, fit)
    unfitted = Tried(Proposal('step_mass', {}, {}, 2000.0), 2000.0, {}, None)
    assert closing.is_closed([second, first, unfitted], None) is is_closed
    assert not closing.is_closed([unfitted], None)


@pytest.mark.parametrize(
    ('cause', 'left', 'is_done'),
    [('load_offset', 4.0, True), ('load_offset', 6.0, False), ('landing_length', 4.0, False)],
)
def test_what_left_nearly_nothing_is_not_fitted_from_afar_again(monkeypatch, cause, left, is_done):
    monkeypatch.setattr(closing, 'excess_of', lambda place, _: place)
    best = Tried(Proposal('load_offset', {}, {}, 900.0), 990.0, {}, SimpleNamespace(place=left))
    other = Tried(LANDING, 300.0, {}, SimpleNamespace(place=1.0))
    unfitted = Tried(ROLLING, 2_000.0, {}, None)
    sought = Proposal(cause, {'which': 'upper'} if cause == 'landing_length' else {}, {}, 950.0)
    assert closing.is_done(1_000.0, [other, best, unfitted], sought, None) is is_done
    assert not closing.is_done(1_000.0, [unfitted], sought, None)


@pytest.mark.parametrize(('left', 'is_riddle'), [(20.0, False), (40.0, True)])
def test_what_leaves_a_quarter_is_followed(monkeypatch, left, is_riddle):
    monkeypatch.setattr(closing, 'is_open', lambda *_: True)
    monkeypatch.setattr(closing, 'excess_of', lambda place, _: place)
    best = Tried(ROLLING, 200.0, {}, SimpleNamespace(place=left))
    unfitted = Tried(LANDING, 900.0, {}, None)
    assert closing.is_riddle(100.0, [best, unfitted], None) is is_riddle


@pytest.mark.issue(6)
@pytest.mark.parametrize(
    ('is_open', 'stretched', 'used_up', 'gain', 'is_hiding'),
    [
        (False, True, False, -240.0, True),
        (False, False, True, -240.0, True),
        (False, False, False, -240.0, False),  # as good as any
        (True, True, True, -240.0, False),  # what is open says so by itself
        (False, True, True, 90.0, False),  # another cause explains more than the tolerances do
    ],
)
def test_what_is_hidden_while_nothing_is_open_is_sought_where_nothing_else_explains_more(
    monkeypatch, is_open, stretched, used_up, gain, is_hiding
):
    for name, told in (('is_open', is_open), ('is_stretched', stretched), ('is_used_up', used_up)):
        monkeypatch.setattr(closing, name, lambda *_, told=told: told)
    fitted = Tried(ROLLING, gain, {}, SimpleNamespace(place=None))
    unfitted = Tried(LANDING, 300.0, {}, None)
    assert closing.is_hiding(None, [fitted, unfitted], None) is is_hiding


@pytest.mark.parametrize(
    ('cause', 'left', 'is_local'),
    [
        ('link_elongation', 490.0, True),
        ('link_elongation', 510.0, False),  # all else may be more
        ('landing_length', 10.0, False),  # of a form that others of the whole machine share
    ],
)
def test_nothing_whole_is_sought_beside_a_link_that_explains_most(
    monkeypatch, cause, left, is_local
):
    monkeypatch.setattr(closing, 'excess_of', lambda place, _: place)
    best, other, unfitted = (
        Tried(
            Proposal(c, {}, {}, 0.0), gain, {}, None if at is None else SimpleNamespace(place=at)
        )
        for c, gain, at in (
            (cause, 5e3, left),
            ('roller_drag', 4e3, 1.0),
            ('step_mass', 9e3, None),
        )
    )
    assert closing.is_local(1_000.0, [other, best, unfitted], None) is is_local
    assert not closing.is_local(1_000.0, [unfitted], None)
