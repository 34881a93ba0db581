"""What several recordings leave in one form."""

from dataclasses import replace
from types import SimpleNamespace

from pools import stand_in
import pytest

from escalator_twin import campaign
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.leftovers import BEYOND_LAW, names_all, repeated_by
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = pytest.mark.issue(7)

FRICTION = Proposal('tensioner_friction', {}, {'force_N': 140.0}, 1e4, fitted=('force_N',))
STRONGEST = 5e4  # of chi squared


def spring(factor, gain=400.0):
    proposal = Proposal('tensioner_stiffness', {}, {'factor': factor}, gain, fitted=('factor',))
    return Found(proposal, 0.99, {'factor': 0.02}, gain, ())


def scout(left, named=0.99):
    found = ((Found(FRICTION, 1.0, {'force_N': 2.0}, STRONGEST, ()), named),)
    return SimpleNamespace(found=found, left=left)


def test_what_all_searches_leave_alike_is_suggested_with_everybodys_size():
    (effect,) = repeated_by([scout(spring(1.34)), scout(spring(1.42))])
    assert effect.cause == 'tensioner_stiffness'
    assert effect.parameters['factor'] == pytest.approx(1.38, abs=0.005)


@pytest.mark.parametrize('left', [
    None,
    spring(0.6),  # of the other sign
    spring(1.05),  # another size
    spring(1.42, gain=0.9 * BEYOND_LAW * STRONGEST),  # a law's own error
    replace(spring(1.42), proposal=replace(FRICTION, cause='tensioner_preload')),
])  # fmt: skip
def test_what_one_search_leaves_otherwise_is_nothing(left):
    if left is not None and left.proposal.cause == 'tensioner_preload':
        left = replace(
            left,
            proposal=replace(left.proposal, parameters={'factor': 1.4}, fitted=('factor',)),
        )
    assert repeated_by([scout(spring(1.4)), scout(left)]) == []


def test_sizes_that_are_each_others_opposite_are_nothing():
    def landing(delta):
        where: dict[str, object] = {'which': 'upper'}
        sizes = {'delta_m': delta}
        proposal = Proposal('landing_length', where, sizes, 400.0, fitted=('delta_m',))
        return Found(proposal, 0.99, {'delta_m': 1e-4}, 400.0, ())

    assert repeated_by([scout(landing(6e-3)), scout(landing(-6e-3))]) == []
    assert len(repeated_by([scout(landing(6e-3)), scout(landing(6e-3))])) == 1


def test_one_search_repeats_nothing():
    assert repeated_by([scout(spring(1.4))]) == []
    assert repeated_by([]) == []


def test_a_wave_has_a_phase_in_each_recording_and_is_not_suggested():
    wave = Proposal(
        'drive_ripple', {}, {'amplitude': 0.02, 'phase_rad': 1.0}, 400.0, fitted=('amplitude',)
    )
    left = Found(wave, 0.99, {'amplitude': 1e-3}, 400.0, ())
    assert repeated_by([scout(left), scout(left)]) == []


def test_a_search_names_what_it_is_sure_of():
    assert names_all(scout(None), [])
    assert names_all(scout(None), [FRICTION])
    assert not names_all(scout(None, named=0.4), [FRICTION])
    assert not names_all(scout(None), [FRICTION, spring(1.4).proposal])


@pytest.mark.parametrize('holds', [True, False])
def test_the_first_are_searched_again_where_the_later_have_it_as_well(holds, monkeypatch):
    """And are left as they were where one of the later has not."""
    asked = []

    class EnoughError(Exception):
        """The searches are done."""

    def search(path, suggested, **_):
        asked.append((path, [p.cause for p in suggested.sure]))
        named = [(Found(FRICTION, 1.0, {'force_N': 2.0}, STRONGEST, ()), 0.99)]
        if suggested.sure and (holds or path != 'd'):
            named.append((spring(1.4), 0.99))
        left = None if suggested.sure else spring(1.4)
        return SimpleNamespace(found=tuple(named), left=left, is_placed=True)

    def fit(paths, _machine, scouts, *_):
        asked.append(('all', paths, [len(s.found) for s in scouts]))
        raise EnoughError

    stand_in(monkeypatch, diagnose_bag=search, fit_bags=fit)
    with pytest.raises(EnoughError):
        campaign.diagnose_together(['a', 'b', 'c', 'd'], 'machine.yaml')
    both = ['tensioner_friction', 'tensioner_stiffness']
    expected = [('a', []), ('b', []), ('c', both), ('d', both)]
    if holds:
        expected += [('a', both), ('b', both), ('all', ['a', 'b', 'c', 'd'], [2, 2, 2, 2])]
    else:
        expected += [('all', ['a', 'b', 'c', 'd'], [1, 1, 2, 1])]
    assert asked == expected


@pytest.mark.parametrize(
    ('second', 'expected'),
    [
        (FRICTION, []),
        (None, [('b', ['tensioner_friction', 'gauge_gain'], [1, 0])]),
    ],
    ids=['named by both', 'named by one'],
)
def test_a_search_that_does_not_name_an_effect_of_the_machine_is_asked_for_it(
    second, expected, monkeypatch
):
    """Of an instrument's fault, which may have come between the two, it is not."""
    gauge = Proposal('gauge_gain', {'link': 'left_a'}, {'factor': 1.1}, 900.0, fitted=('factor',))
    asked = []

    class EnoughError(Exception):
        """All were asked."""

    def search(path, **_):
        effects = [FRICTION, gauge] if path == 'a' else [second] if second else []
        found = [(Found(p, 0.99, {p.fitted[0]: 0.01}, p.gain, ()), 0.99) for p in effects]
        return SimpleNamespace(found=tuple(found), left=None, rolled=None, is_placed=True)

    def confirm(path, effects, **_):
        asked.append([path, [e.cause for e in effects]])
        sds = tuple({e.fitted[0]: 0.01} for e in effects)
        return SimpleNamespace(effects=tuple(effects), sd=sds, rolled=None)

    def decide(_groups, _scouts, confirmed, silent, _together):
        assert confirmed == []
        for row in asked:
            row.append([len(rows) for rows in silent])
        raise EnoughError

    stand_in(monkeypatch, diagnose_bag=search, confirm_bag=confirm, decide=decide)
    with pytest.raises(EnoughError):
        campaign.diagnose_together(['a', 'b'], 'machine.yaml')
    assert [tuple(row) for row in asked] == expected
