"""One fit for several recordings of one machine: sizes and tolerances are the same in all of them.

The recordings are made by the generator (synthetic), whose machine has tolerances of its own.
"""

from dataclasses import replace

import pytest
from rig.machine import Case
from rig.make import Effect, make, Order, write
from searches import CHAIN, LINK, LONGER_M, scout, told, TOLD_M
import trials

from escalator_twin import bagfile
from escalator_twin.diagnosis import points, shared, together
from escalator_twin.diagnosis.campaign import decide, union_of
from escalator_twin.diagnosis.confirm import confirm_recording
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.points import Part, Point
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.shared import fit_together, Shared
from escalator_twin.diagnosis.unknowns import mean_of
from escalator_twin.errors import RecordingError

pytestmark = pytest.mark.issue(7)

ROLLER = Proposal(
    'roller_eccentricity', {'axle': 41, 'side': 'left'},
    {'amplitude_m': 4e-4, 'phase_rad': 0.3, 'slip': 0.0}, 1e4,
    fitted=('amplitude_m', 'phase_rad', 'slip'),
)  # fmt: skip
FRAME = Proposal(
    'truss_resonance', {},
    {'frequency_hz': 5.7, 'damping_ratio': 0.03, 'modal_mass_kg': 5400.0}, 1e4,
    fitted=('frequency_hz', 'damping_ratio', 'modal_mass_kg'),
)  # fmt: skip
GAUGE = Proposal('gauge_gain', {'link': 'left_a'}, {'factor': 1.1}, 900.0, fitted=('factor',))
STEP = Proposal(
    'guide_step', {'s_m': 17.7, 'side': 'right'}, {'height_m': 1.5e-3, 'length_m': 0.06}, 1e4,
    fitted=('height_m', 'length_m', '@s_m'),
)  # fmt: skip
CASES = (Case(0.5, 1, 0.0, 3000.0), Case(0.5, -1, 75.0, 6000.0))
SEED = 251198


@pytest.fixture(scope='module')
def contexts(tmp_path_factory):
    machine = trials.prototype()
    folder = tmp_path_factory.mktemp('shared')
    effects = (Effect('chain_elongation', {'side': 'both'}, {'length_m': LONGER_M}),)
    found = []
    for k, case in enumerate(CASES):
        write(make(Order(SEED + k, case, 60.0, effects, machine_seed=SEED)), folder / str(k), None)
        recording = bagfile.read(folder / str(k), machine)
        found.append(prepare_tolerances(recording, machine, load_floor(machine)))
    return found


@pytest.mark.slow
def test_a_chain_is_as_long_as_it_is_hidden_from_far_off(contexts):
    found = fit_together([Part(context, (CHAIN,)) for context in contexts], jobs=2, rounds=1)
    print(found)
    assert found.effects[0].parameters['length_m'] == pytest.approx(LONGER_M, rel=0.05)
    assert max(abs(z) for z in found.turned.values()) <= 2.5
    assert not any(name.startswith('experiment.') for name in found.turned)


@pytest.mark.slow
def test_a_frame_is_as_heavy_as_it_is_hidden(tmp_path):
    """What one speed says of its frequency another one says of its mass."""
    machine, parts = trials.prototype(), []
    hidden = {'frequency_hz': 5.62, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}
    cases = (Case(0.5, 1, 75.0, 3000.0), Case(0.25, -1, 0.0, 6000.0))
    for k, case in enumerate(cases):
        effects = (Effect('truss_resonance', {}, hidden),)
        write(
            make(Order(SEED + k, case, 60.0, effects, machine_seed=SEED)), tmp_path / str(k), None
        )
        recording = bagfile.read(tmp_path / str(k), machine)
        parts.append(Part(prepare_tolerances(recording, machine, load_floor(machine)), (FRAME,)))
    found = fit_together(parts, jobs=2, rounds=1)
    print(found)
    told = found.effects[0].parameters
    assert told['modal_mass_kg'] == pytest.approx(4500.0, rel=0.1)
    assert told['frequency_hz'] == pytest.approx(5.62, rel=0.02)
    # searches tell theirs without the channels that rattling shakes, whatever was found
    for part, level in zip(parts, found.levels, strict=True):
        place = JointFit(part.context, (), None).beside(found.effects, found.turned)
        assert level < 0.9 * place.stage.judged(place.fitted, 'truss_resonance')


@pytest.mark.slow
def test_another_recording_begins_from_the_tolerances_that_others_have(contexts):
    """And tells the size as it is, though what is suggested is 8 % off."""
    fit = fit_together([Part(contexts[0], (told(LONGER_M),))], rounds=0)
    near = told(1.08 * LONGER_M)
    other = contexts[1].recording
    confirmed = confirm_recording(other, trials.prototype(), [near], shared=fit.turned)
    print(confirmed.effects, confirmed.sd)
    assert confirmed.effects[0].parameters['length_m'] == pytest.approx(LONGER_M, rel=0.06)
    assert not confirmed.unexplained.significant


@pytest.mark.parametrize(
    ('named', 'chosen', 'worth'),
    [
        ([[CHAIN], [CHAIN]], ['chain_elongation'], True),
        ([[CHAIN]], ['chain_elongation'], False),
        ([[CHAIN], [CHAIN], []], ['chain_elongation'], True),
        ([[CHAIN], [], []], [], False),
        ([[LINK, GAUGE], [LINK, GAUGE]], ['link_elongation'], False),
        ([[GAUGE], [GAUGE]], [], False),
        ([[FRAME], [FRAME]], ['truss_resonance'], True),
        ([[STEP], [STEP]], ['guide_step'], False),
    ],
    ids=[
        'both',
        'one recording',
        'two of three',
        'one of three',
        'one link',
        'an instrument',
        'a frame',
        "a rail's step",
    ],
)
def test_what_several_searches_name_of_the_whole_machine_is_fitted_together(named, chosen, worth):
    scouts = [scout(*row) for row in named]
    groups = union_of(scouts)
    found = [groups[k][0][0].proposal.cause for k in together.chosen_of(groups, len(scouts))]
    assert found == chosen
    assert together.is_worth_it(groups, len(scouts)) is worth


def test_how_a_roller_stood_is_each_recordings_own():
    other = replace(ROLLER, parameters={**ROLLER.parameters, 'phase_rad': -2.0})
    assert together.own_of(scout(CHAIN, other, LINK), [LINK, ROLLER]) == (LINK, other)
    # how it stood where nobody has told is not known, how long a link is, is
    assert together.own_of(scout(CHAIN), [LINK, ROLLER]) == (LINK,)


def fit_is(monkeypatch, levels, spread=5e-6, length_m=1.5e-4):
    asked = []

    def fit(parts, _jobs):
        asked.extend(parts)
        effects = tuple(replace(e, parameters={'length_m': length_m}) for e in parts[0].effects)
        return Shared(effects, {'chain.mass': 0.4}, ({'length_m': spread},), levels)

    monkeypatch.setattr(together, 'fit_together', fit)
    scouts = [scout(told(1.4e-4), LINK, GAUGE), scout(told(1.8e-4), LINK, GAUGE)]
    groups = union_of(scouts)
    return together.fitted_together(['first', 'second'], scouts, groups), groups, asked


@pytest.mark.parametrize('spread', [1e-6, 5e-5, float('inf')])
def test_the_fit_begins_at_the_mean_and_is_no_surer_than_it(monkeypatch, spread):
    found, groups, asked = fit_is(monkeypatch, (1e4, 1.1e4), spread)
    chain = next(k for k, g in enumerate(groups) if g[0][0].proposal.cause == CHAIN.cause)
    assert [part.context for part in asked] == ['first', 'second']
    assert asked[0].effects[0].parameters['length_m'] == pytest.approx(1.6e-4)
    assert [[e.cause for e in part.own] for part in asked] == [['link_elongation']] * 2
    assert list(found.effects) == [chain]
    assert found.turned == {'chain.mass': 0.4}
    (told_sd,) = (
        j.found.sd['length_m']
        for j in decide(groups, 2, [], together=found.effects)
        if j.found.proposal.cause == CHAIN.cause
    )
    assert told_sd >= 1e-5  # of two that are 2e-5 off their mean
    assert told_sd == pytest.approx(spread) or spread != 5e-5


def test_the_fit_begins_with_the_mean_of_the_searches_tolerances():
    ways = [
        {'chain.mass_per_pitch_kg': 2.0, 'experiment.load': 1.0, 'experiment.preload_n': 2.5},
        {'chain.mass_per_pitch_kg': -1.0, 'experiment.load': -2.0},
        {},  # was not searched
    ]
    assert mean_of(ways, {'experiment.preload_n', 'None'}) == {
        ('chain.mass_per_pitch_kg',): pytest.approx(0.5),
        ('experiment.load', '0'): 1.0,
        ('experiment.load', '1'): -2.0,
    }
    assert mean_of([{}], ()) == {}


def test_what_effects_stand_for_is_no_tolerance_that_it_begins_with(monkeypatch):
    monkeypatch.setattr(points, '_with_rails', lambda part: part)

    class BegunError(Exception):
        """The fit has its beginning."""

    class Beginning(shared._Fit):
        each = staticmethod(map)

        def run(self, point):
            return point

        def begun(self, _, beginnings):
            raise BegunError(beginnings)

    spring = replace(CHAIN, cause='tensioner_stiffness', nuisance='tensioner.stiffness')
    drive = replace(CHAIN, cause='drive_stiffness', nuisance='drive.stiffness')
    turned = {'tensioner.stiffness': 2.0, 'drive.stiffness': 1.0, 'chain.mass': 0.5}
    with pytest.raises(BegunError) as told_by:
        Beginning(None).found([Part(None, (CHAIN, spring), (drive,), None, turned)], 1)
    assert told_by.value.args[0] == [((CHAIN, spring), {('chain.mass',): 0.5})]


@pytest.mark.parametrize(
    ('none', 'mean', 'from_mean'),
    # before and after a first step
    [
        ((900.0, 700.0), (500.0, 400.0), True),
        ((900.0, 300.0), (500.0, 400.0), False),
        ((900.0, 700.0), None, False),
    ],
    ids=['the mean', 'no tolerance', 'the mean cannot be run'],
)
def test_it_goes_on_from_where_a_first_step_leads_lower(none, mean, from_mean):
    asked = []

    class Steps(shared._Fit):
        def run(self, point):
            return point

        def taken_anew(self, point):
            if mean is None:
                raise RecordingError('the chain has left its guide')
            return replace(point, levels=(mean[0],))

        def descend(self, point, most=shared.MOST_STEPS, is_anew=True):
            asked.append((point.level, most, is_anew))
            after = dict([none, *([mean] if mean else [])])
            return replace(point, levels=(after.get(point.levels[0], point.levels[0]),)), []

    start = Point((), (), (CHAIN,), {}, (), (none[0],))
    point, _ = Steps(None).begun(start, [((CHAIN,), {('chain.mass',): 0.0})])
    first = [(row[0], 1, True) for row in (none, mean) if row]
    there = mean[1] if from_mean else none[1]
    assert asked == [*first, (there, shared.MOST_STEPS - 1, False)]
    assert point.turned == ({('chain.mass',): 0.0} if from_mean else {})
    asked.clear()
    Steps(None).begun(start, [])
    assert [row[0] for row in asked] == [none[0], none[1]]


def test_it_may_begin_as_each_recording_that_has_all_effects():
    one, other = told(1.2e-4), told(1.8e-4)
    rows = [
        ({'chain.mass': 2.0, 'experiment.load': 1.0}, (one,)),
        ({'chain.mass': -1.0, 'experiment.load': -2.0, 'tensioner.stiffness': 0.5}, (other,)),
        (
            {'chain.mass': 2.5, 'experiment.load': 0.5},
            (),
        ),  # without the chain: turned for want of it
        ({}, ()),
    ]
    parts = [Part(None, (CHAIN,), (), None, turned, sized) for turned, sized in rows]
    loads = {('experiment.load', '0'): 1.0, ('experiment.load', '1'): -2.0}
    assert points.beginnings(parts, {'None'}) == [
        ((CHAIN,), {('chain.mass',): 0.5, ('tensioner.stiffness',): 0.5, **loads}),
        ((one,), {('chain.mass',): 2.0, **loads}),
        ((other,), {('chain.mass',): -1.0, ('tensioner.stiffness',): 0.5, **loads}),
    ]
    # none has them all: the mean of what there is
    bare = [replace(part, sized=()) for part in parts[:2]]
    assert [effects for effects, _ in points.beginnings(bare, ())] == [(CHAIN,)]
    assert points.beginnings(bare, ())[0][1]['chain.mass',] == 0.5
    assert points.beginnings([Part(None, (CHAIN,))], ()) == []


def test_of_some_beginnings_it_goes_on_from_the_nearest():
    levels, ran = {1.9e-4: 700.0, 1.2e-4: 400.0, 1.8e-4: 500.0}, []

    class Steps(shared._Fit):
        def run(self, point):
            size = point.effects[0].parameters['length_m']
            if size == 1.8e-4:
                raise RecordingError('the chain has left its guide')
            return replace(point, levels=(levels[size],))

        def taken_anew(self, point):
            ran.append(point.effects[0])
            return point

        def descend(self, point, *_, **__):
            return point, []

    start = Point((), (), (CHAIN,), {}, (), (900.0,))
    some = [((told(m),), {('chain.mass',): 1.0}) for m in levels]
    assert Steps(None).begun(start, some)[0].effects == (told(1.2e-4),)
    assert ran == [told(1.2e-4)]


def test_every_recording_brings_the_tolerances_of_its_search(monkeypatch):
    asked = []

    def fit(parts, _):
        asked.extend(parts)
        raise RecordingError('enough is known')

    monkeypatch.setattr(together, 'fit_together', fit)
    one, spring = told(1.2e-4), replace(CHAIN, cause='tensioner_stiffness', location={})
    ways = [{'chain.mass': 0.5}, {'chain.mass': 1.5}, {'chain.mass': 2.5}]
    named = [(one, spring), (CHAIN, spring), (CHAIN,)]
    scouts = [scout(*n, turned=turned) for n, turned in zip(named, ways, strict=True)]
    together.fitted_together(list('abcd'), [*scouts, None], union_of(scouts))
    assert [part.turned for part in asked] == [*ways, {}]
    assert [[e.parameters['length_m'] for e in p.sized] for p in asked] == [
        [1.2e-4, TOLD_M], [TOLD_M, TOLD_M], [], [],
    ]  # fmt: skip


def test_a_search_that_misses_a_single_links_effect_is_no_beginning():
    """Its tolerances were turned for want of it."""
    there = scout(told(1.2e-4), LINK, turned={'chain.mass': 0.5})
    assert together.sized_by(there, (CHAIN,), (LINK,)) == (told(1.2e-4),)
    for missing in (scout(told(1.2e-4)), scout(LINK), None):
        assert together.sized_by(missing, (CHAIN,), (LINK,)) == ()


def sized():
    return Shared((CHAIN,), {}, ({'length_m': 1e-6},), (1e4, 1e4, 1e4))


def test_where_one_machine_leaves_more_than_the_searches_it_is_not_taken(monkeypatch):
    assert fit_is(monkeypatch, (1e4, 1.4e4))[0] is not None
    assert fit_is(monkeypatch, (1e4, 1.6e4))[0] is None


def test_where_it_cannot_be_run_the_mean_stays(monkeypatch):
    def fit(*_):
        raise RecordingError('the chain has left its guide')

    monkeypatch.setattr(together, 'fit_together', fit)
    scouts = [scout(CHAIN), scout(CHAIN)]
    assert together.fitted_together(['a', 'b'], scouts, union_of(scouts)) is None


def test_the_one_fits_size_is_told_where_all_beside_which_it_was_made_are_accepted(monkeypatch):
    found, groups, _ = fit_is(monkeypatch, (1e4, 1e4))
    accepted = decide(groups, 2, [], together=found.effects)
    sizes = {j.found.proposal.cause: j.found.proposal.parameters for j in accepted}
    assert sizes['chain_elongation'] == {'length_m': 1.5e-4}
    assert sizes['link_elongation'] == {'length_m': pytest.approx(3e-3)}
    assert found.holds(accepted, groups)
    assert not found.holds(
        [j for j in accepted if j.found.proposal.cause != 'link_elongation'], groups
    )
