"""What tolerances explain without an effect is not what the effect explains."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import bounds, fitting, hollows, seeking
from escalator_twin.diagnosis import walk as module
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import LARGEST
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.walk import walk
from escalator_twin.diagnosis.walked import Bench
from escalator_twin.errors import EscalatorError

pytestmark = pytest.mark.issue(6)

SPRING = 'tensioner.stiffness_n_m'
STIFF = Proposal(
    'tensioner_stiffness', {}, {'factor': 1.08}, 1600.0, fitted=('factor',), nuisance=SPRING
)
STEP = Proposal('guide_step', {'s_m': 6.7, 'side': 'left'}, {'height_m': 6e-4}, 2600.0)


@pytest.fixture(autouse=True)
def held(monkeypatch):
    """Return what tolerances hold beyond what a good machine has, to be filled."""
    beyond = {}
    monkeypatch.setattr(hollows, 'beyond_tolerance', lambda _: beyond)
    return beyond


class Level(SimpleNamespace):
    """A place, as far as it says what is left and which tolerances are turned."""

    @classmethod
    def of(cls, left, turned=(), everywhere=None):
        """Return one with ``left`` in the quiet channels, and ``everywhere`` in all of them."""

        def judged(_fitted, cause=None):
            return left if cause is None or everywhere is None else everywhere

        stage = SimpleNamespace(turned=dict(turned), tolerances={SPRING: 0.02}, judged=judged)
        return cls(stage=stage, fitted=None)


def changed(one, **values):
    return SimpleNamespace(**{**vars(one), **values})


def fitted(effect, left):
    context = SimpleNamespace(floor=None)
    polished = Polished(context, Level.of(left, {'chain.mass': 1.1}), (effect,), ({},))
    return Tried(effect, effect.gain, {}, polished)


@pytest.mark.parametrize(
    ('effect', 'with_it', 'without', 'aligned', 'is_nearer'),
    [
        (STEP, 11500.0, 11520.0, 11300.0, True),
        (STIFF, 12500.0, 12400.0, 12400.0, True),
        (STEP, 11500.0, 12900.0, 11300.0, False),  # its tolerances take less than half without it
        (STEP, 11500.0, 11520.0, 12900.0, False),  # or do once they are run
        (STEP, 14100.0, 14000.0, 13000.0, False),  # explains nothing where these are judged
    ],
)
def test_tolerances_that_take_most_without_the_effect_are_the_machines(
    monkeypatch, effect, with_it, without, aligned, is_nearer
):
    seen = []

    def level_of(_place, stage):
        seen.append(stage.turned)
        return without

    monkeypatch.setattr(hollows, 'level_of', level_of)
    monkeypatch.setattr(hollows, 'replace', changed)
    monkeypatch.setattr(hollows, 'with_own_tolerances', lambda *_: SimpleNamespace(place=None))
    monkeypatch.setattr(hollows, 'beside', lambda *_, turned, **__: Level.of(aligned, turned))
    found = hollows.out_of_hollow(None, Level.of(14100.0), (), fitted(effect, with_it))
    assert (found is not None) == is_nearer
    own = (
        {SPRING: LARGEST} if effect is STIFF else {}
    )  # 4 tolerances, of which a good machine has 2.5
    assert all(turned == {'chain.mass': 1.1, **own} for turned in seen)
    if found is not None:
        place = found.place
        assert found.context.place is place
        assert place.stage.turned == {'chain.mass': 1.1, **own}


@pytest.mark.parametrize(('name', 'is_nearer'), [(SPRING, False), ('tensioner.other', True)])
def test_a_tolerance_that_holds_the_effect_after_all_is_no_good_machines(
    monkeypatch, held, name, is_nearer
):
    """Beside a longer link a spring of 1.4 was taken up by its tolerance's slope, eleven of them."""
    monkeypatch.setattr(hollows, 'level_of', lambda *_: 12400.0)
    monkeypatch.setattr(hollows, 'replace', changed)
    monkeypatch.setattr(hollows, 'with_own_tolerances', lambda *_: SimpleNamespace(place=None))
    monkeypatch.setattr(hollows, 'beside', lambda *_, turned, **__: Level.of(12400.0, turned))
    held[name] = 10.6
    found = hollows.out_of_hollow(None, Level.of(14100.0), (), fitted(STIFF, 12500.0))
    assert (found is not None) == is_nearer


def test_what_is_known_is_not_fitted_beside_a_tolerance_that_holds_the_effect(monkeypatch, held):
    class Fit:
        def __init__(self, *_):
            pass

        def beside(self, *_):
            return Level.of(8600.0)

    def fitted_on(*_):
        raise AssertionError('it costs a fit')

    monkeypatch.setattr(hollows, 'JointFit', Fit)
    monkeypatch.setattr(hollows, 'fitted_on', fitted_on)
    held[SPRING] = 10.6
    link = Proposal('link_elongation', {'link': 23}, {'length_m': 3e-3}, 25218.0)
    polished = Polished(None, Level.of(8490.0), (link, STIFF), ({}, {}))
    tried = Tried(STIFF, 775.0, {}, polished)
    assert hollows.out_of_hollow(None, Level.of(9265.0), [link], tried) is None


def test_tolerances_that_no_machine_runs_with_end_no_diagnosis(monkeypatch):
    def level_of(*_):
        raise EscalatorError('the simulation diverged')

    monkeypatch.setattr(hollows, 'level_of', level_of)
    monkeypatch.setattr(hollows, 'replace', lambda *_, **__: None)
    assert hollows.out_of_hollow(None, Level.of(14100.0), (), fitted(STEP, 11500.0)) is None


@pytest.mark.parametrize(
    ('run', 'fitted_on', 'is_nearer'),
    [
        (15900.0, 15851.0, True),
        (19900.0, 15851.0, False),  # run once, its tolerances take less than half without it
        (15900.0, 19900.0, False),  # or do once what is known was fitted from there
    ],
)
def test_so_are_those_beside_what_is_known(monkeypatch, run, fitted_on, is_nearer):
    drag = Proposal('guide_drag', {'s_from_m': 9.2, 's_to_m': 11.8}, {'force_N': 50.0}, 193215.0)
    tolerances, asked = {'chain.mass': 1.1}, []
    # what the step gains is gained in a step's x and z alone: there it is judged
    place, with_step, there, last = (
        Level.of(11400.0, turned, left)
        for turned, left in (({}, 21821.0), (tolerances, 15855.0), ({}, run), ({}, fitted_on))
    )

    class Fit:
        def __init__(self, *_):
            pass

        def beside(self, effects, turned):
            asked.append((effects, turned))
            return there

    def fitted_on(_context, known, effects, turned, _jobs):
        assert known == [drag]
        asked.append((effects, turned))
        return Polished('context', last, (drag,), ({},))

    monkeypatch.setattr(hollows, 'JointFit', Fit)
    monkeypatch.setattr(hollows, 'fitted_on', fitted_on)
    monkeypatch.setattr(hollows, 'freed', lambda place, _: place)
    monkeypatch.setattr(
        hollows,
        'replace',
        lambda one, **v: one if isinstance(one, Polished) else changed(one, **v),
    )
    tried = Tried(STEP, 5966.0, {}, Polished(None, with_step, (drag, STEP), ({}, {})))
    found = hollows.out_of_hollow(None, place, [drag], tried)
    assert (found is not None) == is_nearer
    if found is not None:
        assert found.place is last
        assert asked == [((drag,), tolerances)] * 2


def is_open_beside_all(monkeypatch):
    monkeypatch.setattr(module, 'freed', lambda place, _: place)
    monkeypatch.setattr(seeking, 'may_hide', lambda *_: False)
    for where in (module, seeking):
        monkeypatch.setattr(where, 'is_in_one_gauge', lambda *_: False)
    monkeypatch.setattr(module, 'explained_by', lambda *_: 1.0)
    for name, value in {
        'is_open': True, 'is_stretched': False, 'is_used_up': False, 'excess_of': 2e4, 'fell_by': 1e9,
    }.items():  # fmt: skip
        monkeypatch.setattr(bounds, name, lambda *_, __value=value: __value)


def test_a_round_begins_anew_beside_the_nearer_machine_once(monkeypatch):
    far, near = Level.of(14100.0), Level.of(11300.0)
    is_open_beside_all(monkeypatch)
    asked, searched = [], []

    def propose(_context, place, _jobs):
        searched.append(place)
        return [STIFF] if place in (far, near) else []

    def attempt(_context, _place, _known, chosen, *_):
        return [fitted(p, 9000.0) for p in chosen]

    def nearer(context, place, known, _tried, _jobs):
        asked.append((place, list(known)))
        return None if known else Polished(context, near, (), ())

    bench = Bench(
        propose, attempt, lambda *_: None, lambda place, _: place, lambda *_: None, lambda *_: {},
        nearer,
    )  # fmt: skip
    found = walk(SimpleNamespace(place=far, floor=None), bench=bench)
    assert searched[:2] == [far, near]
    assert asked == [(far, [])]
    assert [f.proposal for f in found.found] == [STIFF]
    assert found.before is near


@pytest.mark.parametrize('is_over', [False, True])
def test_a_round_beside_what_is_known_begins_anew_too(monkeypatch, is_over):
    is_open_beside_all(monkeypatch)
    first, hollow, near = Level.of(2e5), Level.of(21821.0), Level.of(15851.0)
    monkeypatch.setattr(bounds, 'is_open', lambda place, *_: not (is_over and place is near))
    drag = Proposal(
        'guide_drag', {'s_from_m': 9.2, 's_to_m': 11.8}, {'force_N': 49.0}, 193215.0,
        fitted=('force_N',),
    )  # fmt: skip
    better = replace(drag, parameters={'force_N': 50.8})
    beside_first = SimpleNamespace(place=first, floor=None)
    searched, asked = [], []

    def propose(_context, place, _jobs):
        searched.append(place)
        return [{id(first): drag, id(hollow): STEP, id(near): STIFF}[id(place)]]

    def attempt(_context, place, known, chosen, *_):
        if place is near:
            return [Tried(replace(STIFF, parameters={'factor': 1.0}), 0.0, {})]
        after = hollow if place is first else Level.of(15900.0)
        return [
            Tried(
                p, p.gain, {}, Polished(beside_first, after, (*known, p), ({},) * (1 + len(known)))
            )
            for p in chosen
        ]

    def nearer(context, place, known, tried, _jobs):
        asked.append((place, tuple(known), tried.proposal.cause))
        return Polished(context, near, (better,), ({'force_N': 0.4},)) if known else None

    bench = Bench(
        propose, attempt, lambda *_: None, lambda place, _: place, lambda *_: None, lambda *_: {},
        nearer,
    )  # fmt: skip
    found = walk(beside_first, bench=bench)
    assert searched == [first, hollow] + ([] if is_over else [near])
    assert asked == [(first, (), 'guide_drag'), (hollow, (drag,), 'guide_step')]
    assert [f.proposal for f in found.found] == [better]
    assert found.found[0].sd == {'force_N': 0.4}
    assert found.before is first
    assert found.after is near
    assert 'guide_step' not in {w.proposal.cause for w in found.weighed}


def test_beside_faults_of_the_measurement_alone_there_is_nothing_to_fit_on(monkeypatch):
    gauge = Proposal('gauge_gain', {'link': 'left_a'}, {'factor': 1.09}, 5e4)
    there, tolerances = Level.of(15851.0), {'chain.mass': 1.1}

    class Fit:
        def __init__(self, *_):
            pass

        def beside(self, effects, turned):
            assert (effects, turned) == ((), tolerances)
            return there

    monkeypatch.setattr(fitting, 'JointFit', Fit)
    monkeypatch.setattr(fitting, 'polish', lambda *_, **__: pytest.fail('nothing to fit'))
    found = fitting.fitted_on('context', [gauge], (), tolerances)
    assert found == Polished('context', there, (), ())
