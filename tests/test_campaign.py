"""What is asked of the recordings of one machine, and in which order."""

from types import SimpleNamespace

from pools import stand_in
import pytest
from searches import CHAIN, found_of, LINK, scout, told, TOLD_M
import trials

from escalator_twin import campaign
from escalator_twin.diagnosis import together
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.suggested import NOTHING

pytestmark = pytest.mark.issue(7)


@pytest.mark.parametrize('is_taken', [True, False])
def test_all_others_are_put_beside_the_one_fit_where_there_is_one(monkeypatch, is_taken):
    sized = together.Together(
        {0: (told(1.5e-4), {'length_m': 1e-6})}, frozenset({0}), {'chain.mass': 0.4}
    )
    asked = []

    class EnoughError(Exception):
        """All were asked."""

    def search(path, **_):
        found = () if path == 'b' else ((found_of(CHAIN, 1e-5), 0.99),)
        return SimpleNamespace(found=found, left=None, rolled=None, is_placed=True)

    def fit(paths, _machine, _scouts, _groups, jobs):
        asked.append((paths, jobs))
        return sized if is_taken else None

    def confirm(path, effects, seed, shared, **_):
        asked.append((path, effects[0].parameters['length_m'], seed, shared))
        return SimpleNamespace(effects=tuple(effects), sd=({'length_m': 1e-5},), rolled=None)

    def decide_with(*_, **__):
        raise EnoughError

    stand_in(
        monkeypatch, diagnose_bag=search, fit_bags=fit, confirm_bag=confirm, decide=decide_with
    )
    with pytest.raises(EnoughError):
        campaign.diagnose_together(['a', 'b'], 'machine.yaml', seed=7, jobs=3)
    size, turned = (1.5e-4, {'chain.mass': 0.4}) if is_taken else (TOLD_M, None)
    assert asked == [(['a', 'b'], 3), ('b', size, 7, turned)]


class Asked:
    """Stands for `campaign.Work`: writes down what is asked for."""

    def __init__(self, names, is_open):
        self.names, self.is_open, self.asked = names, is_open, []
        self.paths, self.total = list('abcdef'), 1.0

    def search(self, some, suggested=NOTHING):
        if some:
            asked = [[e.cause for e in part] for part in (suggested.sure, suggested.perhaps)]
            self.asked.append(('search', list(some), *asked))
        return {k: SimpleNamespace(found=scout(*self.names[k]).found, left=None) for k in some}

    def fit(self, some, scouts, groups):
        self.asked.append(('fit', list(some), list(scouts), len(groups)))
        return None, frozenset(some)

    def confirm(self, some, groups, _):
        self.asked.append(('confirm', list(some), len(groups)))
        return {k: SimpleNamespace(is_open=k in self.is_open) for k in some}


FIRST = [('search', [0, 1], [], [])]
CLOSED = [('fit', [0, 1, 2, 3], [0, 1], 1), ('confirm', [2, 3], 1)]
CAUSE = [CHAIN.cause]


@pytest.mark.parametrize(
    ('second', 'is_open', 'expected'),
    [
        ([CHAIN], [], [*CLOSED, ('confirm', [4, 5], 1)]),
        (
            [CHAIN], [3, 4],
            [
                *CLOSED, ('search', [3], CAUSE, []), ('fit', [0, 1, 2, 3], [0, 1, 3], 2),
                ('confirm', [2, 4, 5], 2),
            ],
        ),
        (
            [], [],
            [('search', [2, 3], [], []), ('fit', [0, 1, 2, 3], [0, 1, 2, 3], 2), ('confirm', [4, 5], 2)],
        ),
    ],
    ids=['nothing is open', 'one is open', 'the first do not agree'],
)  # fmt: skip
def test_the_later_are_searched_where_the_first_leave_something_open(second, is_open, expected):
    work = Asked([[CHAIN], second, [CHAIN], [CHAIN, LINK]], is_open)
    looked = campaign.look_together(work, [0, 1, 2, 3])
    assert work.asked == [*FIRST, *expected]
    assert sorted([*looked.scouts, *looked.confirmed]) == list(range(6))
    assert looked.fitted == frozenset(range(4))


def test_beside_a_single_link_all_that_are_fitted_to_are_searched():
    work = Asked([[LINK]] * 4, [])
    campaign.look_together(work, [0, 1, 2, 3])
    later = ('search', [2, 3], [LINK.cause], [])
    assert work.asked == [
        *FIRST, later, ('fit', [0, 1, 2, 3], [0, 1, 2, 3], 1), ('confirm', [4, 5], 1),
    ]  # fmt: skip


@pytest.mark.parametrize('both', [CHAIN, LINK])
def test_beside_a_single_link_the_later_try_what_one_of_the_first_names_alone(both):
    more = LINK if both is CHAIN else CHAIN
    work = Asked([[both, more], [both], [both], [both]], [])
    campaign.look_together(work, [0, 1, 2, 3])
    assert work.asked[1] == ('search', [2, 3], [both.cause], [more.cause])


def test_beside_none_they_search_anew():
    spring = Proposal('drive_stiffness', {}, {'factor': 0.5}, 1e3, fitted=('factor',))
    work = Asked([[CHAIN, spring], [CHAIN], [CHAIN], [CHAIN]], [])
    campaign.look_together(work, [0, 1, 2, 3])
    assert work.asked[1] == ('search', [2, 3], CAUSE, [])


def test_of_a_machine_of_free_bodies_every_recording_is_searched():
    """Its tolerances and effects are put beside a recording by its own search alone."""
    work = Asked([[CHAIN], [CHAIN], [], [CHAIN], [CHAIN], [CHAIN]], [])
    looked = campaign.search_all(work)
    assert work.asked == [*FIRST, ('search', [2, 3, 4, 5], CAUSE, [])]
    assert list(looked.scouts) == list(range(6))
    assert (looked.together, dict(looked.confirmed)) == (None, {})


def test_such_a_machines_searches_are_asked_for_nothing_more(monkeypatch):
    class EnoughError(Exception):
        """The searches are done."""

    def search(path, **_):
        found = () if path == 'b' else ((found_of(CHAIN, 1e-5), 0.99),)
        return SimpleNamespace(found=found, left=None, rolled=None, is_placed=True)

    def never(*_, **__):
        raise AssertionError

    def decide_with(*_, **__):
        raise EnoughError

    stand_in(
        monkeypatch,
        load_machine=campaign.load_machine,
        law_of=campaign.law_of,
        diagnose_bag=search,
        fit_bags=never,
        confirm_bag=never,
        decide=decide_with,
    )
    kwon = str(trials.ROOT / 'config' / 'machines' / 'kwon.yaml')
    with pytest.raises(EnoughError):
        campaign.diagnose_together(['a', 'b'], kwon)
