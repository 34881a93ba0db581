"""What a good machine may have by itself is nothing unexplained, and gets no name."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from escalator_twin.cli.diagnose import show
from escalator_twin.diagnosis import within as module
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import Unexplained
from escalator_twin.diagnosis.verdict import Weighed
from escalator_twin.diagnosis.walked import Round, Walked
from escalator_twin.diagnosis.within import within_tolerance

pytestmark = pytest.mark.issue(6)

OPEN = Unexplained(True, 0.2, 0.0, {'locked_to': ['time']})
ABOVE = 400.0  # chi squared above a good machine's
PLACE, FITTED = SimpleNamespace(name='before'), SimpleNamespace(name='after')


def hunting(tolerances, gain=390.0):
    numbers = {'relative_amplitude': 1e-3 * tolerances, 'frequency_hz': 0.7, 'phase_rad': 0.0}
    return Proposal('drive_hunting', {}, numbers, gain, fitted=('relative_amplitude',))


def fitted(proposal, gain=None):
    """Return a proposal as the twin was run with it, tolerances beside it."""
    polished = SimpleNamespace(place=FITTED)
    return Tried(proposal, proposal.gain if gain is None else gain, {}, polished)


@pytest.fixture
def settled(monkeypatch):
    """Return what stays open of a last round, with what was run for it."""

    def settle(
        proposals=(), tried=(), rest=OPEN, leaves=False, last=True, attempt=None, likely=0.0
    ):
        ran = []

        def bench_attempt(_context, _place, known, chosen, _jobs):
            ran.append((list(known), list(chosen)))
            return [attempt(p) if attempt else fitted(p) for p in chosen]

        def look(_context, _before, after):
            assert after is FITTED
            return replace(OPEN, share=0.1) if leaves else Unexplained(False, 0.0, 0.9, {})

        monkeypatch.setattr(module, 'excess_of', lambda *_: ABOVE)
        monkeypatch.setattr(module, 'freed', lambda place, _: place)
        monkeypatch.setattr(module, 'look', look)
        context = SimpleNamespace(floor=None)
        row = Round(context, PLACE, (), tuple(proposals), tuple(tried)) if last else None
        weighed = (Weighed(hunting(9.0), 10.0, 0.0, likely),)
        walked = Walked((), PLACE, PLACE, weighed, last=row)
        bench = SimpleNamespace(attempt=bench_attempt, bare=lambda place, _: place)
        again, left = within_tolerance(context, walked, rest, bench)
        return again.weighed, left, ran

    return settle


def test_what_two_tolerances_account_for_is_not_unexplained(settled):
    wave = hunting(2.0)
    weighed, left, ran = settled([wave])
    assert not left.significant
    assert left.signature == {'within_tolerance': 'drive_hunting, 2.0 tolerances'}
    assert ran == [([], [wave])]
    # a candidate without a probability: its evidence says how large it is
    assert (weighed[0].proposal, weighed[0].probability) == (wave, 0.0)
    assert len(weighed) == 2


def test_a_doubtful_candidate_stays_first(settled):
    """What would decide on it is said of the first."""
    weighed, _, _ = settled([hunting(2.0)], likely=0.4)
    assert [w.probability for w in weighed] == [0.4, 0.0]


def test_the_command_says_what_it_is():
    rest = {'significant': False, 'share': 0.0}
    document = {
        'recordings': [{'path': 'a.mcap', 'place_is_certain': True}],
        'effects': [],
        'gain': {'held_out': None, 'split': 'nothing was accepted'},
        'extended_machine': 'out.yaml',
    }
    told, plain = (
        show(document | {'unexplained': rest | {'signature': signature}})
        for signature in ({'within_tolerance': 'drive_hunting, 2.0 tolerances'}, {})
    )
    assert 'within tolerance, and in the data: drive_hunting, 2.0 tolerances\n' in told
    assert 'in the data' not in plain


def test_what_was_run_in_the_last_round_is_not_run_again(settled):
    wave = hunting(2.0)
    weighed, left, ran = settled([wave], [fitted(wave)])
    assert not left.significant
    assert ran == []
    assert weighed[0].proposal is wave


@pytest.mark.parametrize(
    'proposal',
    [
        hunting(4.1),
        hunting(2.0, 0.4 * ABOVE),
        replace(hunting(2.0), nuisance='rolling'),
        Proposal('gauge_gain', {'link': 'left_a'}, {'factor': 1.006}, 390.0),
        Proposal('tensioner_stop', {}, {'displacement_m': 4e-3}, 390.0),
    ],
    ids=['an effect', 'too little', 'tuned', 'of an instrument', 'without a tolerance'],
)
def test_what_is_none_of_a_good_machines_own_is_not_even_run(settled, proposal):
    weighed, left, ran = settled([proposal])
    assert left is OPEN
    assert ran == []
    assert len(weighed) == 1


@pytest.mark.parametrize(
    'attempt',
    [
        lambda p: fitted(replace(p, parameters=hunting(3.1).parameters)),
        lambda p: fitted(p, 0.4 * ABOVE),
        lambda p: Tried(p, p.gain, {}),
    ],
    ids=['larger once it is fitted', 'gains less', 'not fitted'],
)
def test_what_is_none_once_it_is_fitted_accounts_for_nothing(settled, attempt):
    weighed, left, ran = settled([hunting(2.9)], attempt=attempt)
    assert left is OPEN
    assert len(ran) == len(weighed) == 1


def test_where_more_is_left_than_a_good_machine_leaves_all_stays_open(settled):
    weighed, left, _ = settled([hunting(2.0)], leaves=True)
    assert left is OPEN
    assert len(weighed) == 1


def test_nothing_is_run_where_nothing_is_open(settled):
    closed = Unexplained(False, 0.0, 0.9, {})
    assert settled([hunting(2.0)], rest=closed)[1:] == (closed, [])
    assert settled([hunting(2.0)], last=False)[1:] == (OPEN, [])
