"""What is fitted from the machine as described: what promises most, and what a tolerance stands in for."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import begun_afar, closing, from_afar, trial
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.floor import SHAKING
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried

pytestmark = pytest.mark.issue(7)

ROLLING = Proposal('rolling_resistance', {}, {'factor': 0.74}, 500.0)
LANDING = Proposal('landing_length', {'which': 'upper'}, {'delta_m': -3.6e-3}, 18.0)
EDGE = Proposal('landing_length', {'which': 'upper'}, {'delta_m': 2.4e-3}, 0.0)
FRAME = Proposal('truss_resonance', {}, {'frequency_hz': 8.0}, 4e4)
FRICTION = Proposal('tensioner_friction', {}, {'force_N': 180.0}, 9e4)


@pytest.fixture(autouse=True)
def all_reach(monkeypatch):
    """Have every effect's reference be as large as what is open, and none told with another's length."""
    monkeypatch.setattr(begun_afar, 'excess_of', lambda *_: 0.0)
    monkeypatch.setattr(begun_afar, 'at_reference', lambda effect: effect)
    monkeypatch.setattr(begun_afar, 'reaches', lambda *_: True)
    monkeypatch.setattr(from_afar, 'exchanged', lambda *_: [])
    monkeypatch.setattr(from_afar, 'sized', lambda *_: [])


@dataclass(frozen=True)
class Held:
    """Of a context what is replaced in it."""

    knobs: object
    responses: object = None
    floor: object = None


def leveled(chi2, shaken=0.0):
    """Return a machine beside a recording, and what is left there; a cause that shakes is judged by more."""
    stage = SimpleNamespace(judged=lambda fitted, cause='': fitted + shaken * (cause in SHAKING))
    return SimpleNamespace(stage=stage, model=None, fitted=chi2)


@pytest.mark.parametrize(
    ('edges', 'known', 'is_open', 'hides', 'closes', 'fitted'),
    [
        ((), [FRICTION], True, False, False, [ROLLING]),
        ((EDGE,), [FRICTION], True, False, False, [ROLLING, EDGE]),
        ((ROLLING,), [FRICTION], True, False, False, [ROLLING]),  # leads already: once is enough
        # beside nothing known any effect turns tolerances to their edges
        ((EDGE,), [], True, False, False, [ROLLING, EDGE]),
        ((EDGE,), [], True, False, True, [ROLLING]),
        ((EDGE,), [], False, False, False, [ROLLING]),
        ((EDGE,), [], False, True, False, [ROLLING, EDGE]),
    ],
)
def test_what_a_tolerance_stands_in_for_is_fitted_whatever_it_promises(
    monkeypatch, edges, known, is_open, hides, closes, fitted
):
    for module in (from_afar, begun_afar):
        monkeypatch.setattr(module, 'refine', lambda *given: SimpleNamespace(
            proposal=given[3], gain=given[3].gain, model=None
        ))  # fmt: skip
    done = []
    there = SimpleNamespace(
        is_open=not closes, stage=SimpleNamespace(judged=lambda *_: 8e3), fitted=None
    )

    def fitted_beside(_context, _place, _known, refined, _turned, _jobs, level):
        assert level == (8e3 if done else 1e4)  # of what leads
        done.append(refined.proposal)
        polished = Polished(context, there, (), ())
        return Tried(refined.proposal, refined.gain, {}, polished)

    monkeypatch.setattr(begun_afar, 'fitted_beside', fitted_beside)
    monkeypatch.setattr(from_afar, 'is_hiding', lambda *_: hides)
    monkeypatch.setattr(closing, 'is_open', lambda place, *_: place.is_open)
    monkeypatch.setattr(closing, 'excess_of', lambda *_: 100.0)
    context = Held(None, Held({}), None)
    stage = SimpleNamespace(judged=lambda *_: 1e4)
    place = SimpleNamespace(stage=stage, model=None, fitted=None, is_open=is_open)
    afar = Afar(context, place, [ROLLING, LANDING], edges)
    from_afar.tried_from_afar(context, afar, place, known, [], [], 1)
    assert done == fitted


@pytest.mark.parametrize('riddle', [True, False])
def test_effects_of_one_force_are_begun_together_where_nothing_explains_most(monkeypatch, riddle):
    both = Tried(LANDING, 2e3, {}, None)
    monkeypatch.setattr(from_afar, '_tried_afar', lambda *_: [])
    monkeypatch.setattr(from_afar, 'at_edges', lambda *_: [])
    monkeypatch.setattr(from_afar, 'exchanged', lambda *_: [both])
    monkeypatch.setattr(from_afar, 'is_riddle', lambda *_: riddle)
    monkeypatch.setattr(from_afar, '_from_here', lambda *_: [])
    afar = Afar(None, leveled(2e3), [])
    found = from_afar.tried_from_afar(Held(None), afar, leveled(2e3), [FRICTION], [], [], 1)
    assert found == ([both] if riddle else [])


@pytest.mark.parametrize(
    ('riddle', 'known', 'size', 'fits'),
    [
        (True, [], 0.7, True),
        (True, [], 1.399, False),  # where a fit ended already another would end too
        (True, [], None, False),
        (False, [], 0.7, False),
        (True, [FRICTION], 0.7, False),
    ],
)
def test_a_size_of_long_waves_is_fitted_where_nothing_is_known_and_nothing_explains_most(
    monkeypatch, riddle, known, size, fits
):
    spring = replace(ROLLING, cause='tensioner_stiffness', parameters={'factor': 1.4})
    spring = replace(spring, fitted=('factor',))
    start = None if size is None else replace(spring, parameters={'factor': size})
    monkeypatch.setattr(from_afar, 'sized', begun_afar.sized)
    monkeypatch.setattr(from_afar, '_tried_afar', lambda *_: [])
    monkeypatch.setattr(from_afar, 'at_edges', lambda *_: [])
    monkeypatch.setattr(from_afar, 'is_riddle', lambda *_: riddle)
    monkeypatch.setattr(from_afar, '_from_here', lambda *_: [])
    monkeypatch.setattr(begun_afar, 'coarse_start', lambda *_: start)
    monkeypatch.setattr(begun_afar, 'refine', lambda *given: SimpleNamespace(proposal=given[3]))
    begun = []
    monkeypatch.setattr(
        begun_afar,
        'fitted_afar',
        lambda *given: begun.extend(one.proposal for _, one in given[3]) or [],
    )
    afar = Afar(None, SimpleNamespace(stage=None, model=None, fitted=None), [])
    ended = Tried(spring, 1.0, {}, SimpleNamespace(place=leveled(2e3)))
    for name in ('is_local', 'is_closed', 'is_hiding'):
        monkeypatch.setattr(from_afar, name, lambda *_: False)
    from_afar.tried_from_afar(Held(None), afar, leveled(2e3), known, [ended], [], 1)
    assert begun == ([start] if fits else [])


@pytest.mark.parametrize(('left', 'is_sought'), [(400.0, False), (600.0, True)])
def test_beside_a_link_that_explains_most_nothing_is_sought_afar(monkeypatch, left, is_sought):
    monkeypatch.setattr(from_afar, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain, model=None
    ))  # fmt: skip
    monkeypatch.setattr(from_afar, 'fitted_afar', lambda *given: given[3])
    monkeypatch.setattr(closing, 'is_open', lambda *_: True)
    monkeypatch.setattr(closing, 'excess_of', lambda place, _: place.fitted - 1e3)
    monkeypatch.setattr(from_afar, 'is_riddle', lambda *_: False)
    monkeypatch.setattr(from_afar, 'is_hiding', lambda *_: False)
    link = Proposal('link_elongation', {'link': 12}, {'length_m': 3e-3}, 400.0)
    done = Tried(link, 990.0, {}, Polished(None, leveled(1e3 + left), (link,), ({},)))
    afar = Afar(None, leveled(2e3), [ROLLING])
    found = from_afar.tried_from_afar(Held(None), afar, leveled(2e3), [], [done], [], 1)
    assert bool(found) is is_sought


@pytest.mark.issue(6)
@pytest.mark.parametrize(('left', 'fits'), [(4.0, 0), (6.0, 1)])
def test_what_left_nearly_nothing_is_not_fitted_there_again(monkeypatch, left, fits):
    """Of 1000 that are open: below and above a two-hundredth."""
    monkeypatch.setattr(from_afar, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain, model=None
    ))  # fmt: skip
    monkeypatch.setattr(from_afar, 'fitted_afar', lambda *given: given[3])
    monkeypatch.setattr(closing, 'is_open', lambda *_: True)
    monkeypatch.setattr(closing, 'excess_of', lambda place, _: place.left)
    place, there = (
        SimpleNamespace(
            stage=SimpleNamespace(judged=lambda fitted, *_: fitted),
            model=None,
            fitted=x + 1e3,
            left=x,
        )
        for x in (1e3, left)
    )
    done = Tried(ROLLING, 990.0, {}, Polished(None, there, (ROLLING,), ({},)))
    afar = Afar(None, place, [replace(ROLLING, gain=990.0)])
    found = from_afar.tried_from_afar(Held(None), afar, place, [], [done], [], 1)
    assert len(found) == fits


@pytest.mark.parametrize(
    ('known', 'is_fitted'),
    [
        ([], False),
        ([Proposal('roller_flat', {'axle': 3, 'side': 'left'}, {}, 9e4)], False),
        ([Proposal('gauge_gain', {'link': 'left_a'}, {'factor': 1.09}, 9e4)], False),
        ([FRICTION], True),  # the tuned tolerances are another machine's
    ],
)
def test_what_stays_far_above_is_not_fitted_but_beside_another_machine(
    monkeypatch, known, is_fitted
):
    monkeypatch.setattr(from_afar, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain, model=None
    ))  # fmt: skip
    monkeypatch.setattr(from_afar, 'fitted_afar', lambda *given: given[3])
    afar = Afar(None, leveled(2.6e3), [ROLLING])
    others = [leveled(1.4e3), leveled(1e3)]
    with ThreadPoolExecutor(1) as pool:
        found = from_afar._tried_afar(None, afar, None, known, pool, 1, others)
        in_vain = from_afar._tried_afar(None, afar, None, known, pool, 1, others, lambda *_: False)
    assert bool(found) is is_fitted
    assert not in_vain


@pytest.mark.issue(6)
@pytest.mark.parametrize(('gain', 'is_fitted'), [(4.0e4, True), (2.0e4, False)])
def test_a_frame_is_as_far_above_as_its_own_channels_say(monkeypatch, gain, is_fitted):
    """What of a step's x and z a frame explains is beside what it leaves there, not beside nothing."""
    frame = replace(FRAME, gain=gain)
    monkeypatch.setattr(from_afar, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain, model=None
    ))  # fmt: skip
    monkeypatch.setattr(from_afar, 'fitted_afar', lambda *given: given[3])
    afar = Afar(None, leveled(1e4, 4e4), [frame])
    other = leveled(2e3, 1e4)
    with ThreadPoolExecutor(1) as pool:
        found = from_afar._tried_afar(None, afar, None, [], pool, 1, [other])
    assert bool(found) is is_fitted


@pytest.mark.issue(6)
@pytest.mark.parametrize('is_afar', [True, False])
def test_a_frame_is_sought_beside_tolerances_that_were_not_tuned_to_it(monkeypatch, is_afar):
    scanned = []

    def scan(_stage, model, _fitted, proposal, _jobs):
        scanned.append(model)
        return replace(proposal, parameters={'frequency_hz': 6.8})

    bare = SimpleNamespace(
        observation=SimpleNamespace(frame=SimpleNamespace(pitch_m=0.4, speed_m_s=0.5))
    )
    tuned, nominal = (
        SimpleNamespace(
            stage=SimpleNamespace(judged=lambda *_: 9e4, lean=lambda _: bare),
            model=name,
            fitted=None,
        )
        for name in ('tuned', 'nominal')
    )
    fits = []

    def fitted_beside(_context, _place, _known, refined, turned, *_):
        fits.append((refined.proposal, turned))
        return Tried(refined.proposal, refined.gain, {}, Polished(context, tuned, (), ()))

    for module in (trial, from_afar, begun_afar):
        monkeypatch.setattr(module, 'refine', lambda *given: SimpleNamespace(
            proposal=given[3], gain=given[3].gain, model=None
        ))  # fmt: skip
        monkeypatch.setattr(module, 'fitted_beside', fitted_beside)
    monkeypatch.setitem(trial.SCANS, 'truss_resonance', scan)
    monkeypatch.setattr(from_afar, 'is_riddle', lambda *_: False)
    monkeypatch.setattr(from_afar, 'is_hiding', lambda *_: False)
    monkeypatch.setattr(trial, 'shared', lambda _place, tried: tried)
    monkeypatch.setattr(trial, 'locked', lambda _context, _place, tried, _jobs: tried)
    monkeypatch.setattr(trial, '_settled', lambda _place, _known, tried, _jobs: tried)
    followed = []
    monkeypatch.setattr(
        trial, 'from_other_frequencies', lambda *given: followed.append(given[3]) or given[3]
    )
    context = Held(None, Held({}))
    afar = Afar(context, nominal, []) if is_afar else None
    found = trial.try_all(context, tuned, [], [FRAME], 1, afar)
    assert scanned == ['nominal' if is_afar else 'tuned']
    ((proposal, turned),) = fits
    assert proposal.parameters['frequency_hz'] == 6.8
    assert turned == ({} if is_afar else None)  # no tolerance turned, or as they were tuned
    assert [t.proposal for t in found] == [proposal]
    assert followed == found  # along its frequency, before it is named


@pytest.mark.issue(6)
@pytest.mark.parametrize(('gain', 'is_found'), [(300.0, True), (20.0, False)])
def test_a_frame_that_shows_beside_tuned_tolerances_alone_is_fitted_there(
    monkeypatch, gain, is_found
):
    """A weak one is nothing beside a machine as described: what tolerances do there is far more."""
    bare = SimpleNamespace(
        observation=SimpleNamespace(frame=SimpleNamespace(pitch_m=0.4, speed_m_s=0.5))
    )
    place = SimpleNamespace(
        stage=SimpleNamespace(judged=lambda *_: 9e3, lean=lambda _: bare), model=None, fitted=None
    )
    other = Tried(ROLLING, 25.0, {}, Polished(None, place, (), ()))
    monkeypatch.setattr(trial, 'tried_from_afar', lambda *_: [other])
    monkeypatch.setattr(trial, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain, sd={}
    ))  # fmt: skip
    monkeypatch.setitem(
        trial.SCANS, 'truss_resonance',
        lambda *given: replace(given[3], parameters={'frequency_hz': 5.7}),
    )  # fmt: skip
    monkeypatch.setattr(trial, 'fitted_beside', lambda *given, **_: Tried(
        given[3].proposal, given[3].gain, {}, Polished(None, place, (), ())
    ))  # fmt: skip
    monkeypatch.setattr(trial, 'shared', lambda _place, tried: tried)
    monkeypatch.setattr(trial, 'locked', lambda _context, _place, tried, _jobs: tried)
    monkeypatch.setattr(trial, '_settled', lambda _place, _known, tried, _jobs: tried)
    followed = []
    monkeypatch.setattr(
        trial, 'from_other_frequencies', lambda *given: followed.append(given[3]) or given[3]
    )
    found = trial.try_all(
        Held(None), place, [], [replace(FRAME, gain=gain)], 1, Afar(None, place, [])
    )
    assert (found[0].proposal.cause == 'truss_resonance') is is_found
    assert [t.proposal for t in followed] == [found[0].proposal]
    assert (found[0].proposal.parameters == {'frequency_hz': 5.7}) is is_found


def test_of_two_starts_that_are_one_the_better_is_fitted():
    """A slope and a far change lead to one size by a step of the twin, or on either side of none."""
    sizes = {'by slope': 1.7642, 'by a far change': 1.7653, 'much farther': 2.4}
    sizes |= {'as much less': 2.0 - 1.7642, 'as many times less': 1.0 / 1.7642}
    starts = [
        SimpleNamespace(proposal=replace(ROLLING, parameters={'factor': f}, fitted=('factor',)))
        for f in sizes.values()
    ]
    landing = SimpleNamespace(proposal=replace(LANDING, fitted=('delta_m',)))
    kept = from_afar._apart([starts[0], landing, *starts[1:], landing])
    assert kept == [starts[0], landing, *starts[2:]]


@pytest.mark.parametrize(
    ('beyond', 'refined', 'gains', 'begun'),
    [
        ({'tensioner.stiffness_n_m': 10.6}, 910.0, -3440.0, 1),
        ({'tensioner.stiffness_n_m': 10.6}, 910.0, 300.0, 0),  # a fit from none turned leads on
        ({'tensioner.stiffness_n_m': -10.6}, 910.0, -3440.0, 0),  # it is held the other way
        ({'experiment.preload_n': 4.0}, 910.0, -3440.0, 0),
        ({}, 910.0, -3440.0, 0),
        ({'tensioner.stiffness_n_m': 10.6}, -20.0, -3440.0, 0),
    ],
)
def test_what_a_tolerance_holds_is_fitted_from_where_the_tolerances_are(
    monkeypatch, beyond, refined, gains, begun
):
    """Beside a longer link a spring of 1.41 led from none turned to more than without it."""
    name = 'tensioner.stiffness_n_m'
    spring = replace(
        ROLLING, cause='tensioner_stiffness', parameters={'factor': 1.41}, fitted=('factor',),
        nuisance=name, gain=2e3,
    )  # fmt: skip
    base, place = leveled(12e3), leveled(9265.0)
    starts = []

    def refine(_stage, _model, fitted, proposal, _steps):
        gain = proposal.gain if fitted == base.fitted else refined
        return SimpleNamespace(proposal=proposal, gain=gain)

    def fitted_beside(_context, _place, _known, one, turned=None, *_, **__):
        starts.append(turned)
        gain = gains if turned is not None else 775.0
        found = Polished(Held(None, Held({}), None), leveled(9265.0 - gain), (), ())
        return Tried(one.proposal, gain, {}, found)

    monkeypatch.setattr(from_afar, 'refine', refine)
    for module in (from_afar, begun_afar):
        monkeypatch.setattr(module, 'fitted_beside', fitted_beside)
    monkeypatch.setattr(from_afar, 'beyond_tolerance', lambda _: beyond)
    monkeypatch.setattr(closing, 'is_open', lambda *_: True)
    monkeypatch.setattr(closing, 'excess_of', lambda p, _: p.fitted - 7e3)
    context = Held(None, Held({}), None)
    for machine in (base, place):
        machine.stage.lean = lambda _, stage=machine.stage: stage
    link = Proposal('link_elongation', {'link': 23}, {'length_m': 3e-3}, 25218.0)
    afar = Afar(context, base, [spring], ())
    found = from_afar.tried_from_afar(context, afar, place, [link], [], [], 1)
    assert starts == [{}] + [None] * begun
    assert [t.gain for t in found] == [gains] + [775.0] * begun
