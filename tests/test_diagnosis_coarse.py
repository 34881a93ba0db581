"""Sizes that are sought in long waves: which are begun with, which are tuned, which are worth a fit."""

from concurrent.futures import ThreadPoolExecutor
from math import inf
from pathlib import Path
from types import SimpleNamespace

import pytest
from rig.machine import Case
from rig.make import Effect, make, Order, write
from rig.sheet import ANOTHER

from escalator_twin import bagfile
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis import coarse
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.coarse import coarse_start, sizes_of
from escalator_twin.diagnosis.context import beside
from escalator_twin.diagnosis.floor_file import own_floor
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.errors import ExperimentError
from escalator_twin.machine import load_machine

pytestmark = pytest.mark.issue(7)

LONGER = Path(__file__).parent / 'data' / 'longer'
SPRING, PRELOAD = 'tensioner.stiffness_n_m', 'experiment.preload_n'
TOLERANCES = {
    SPRING: 0.02,
    PRELOAD: 0.02,
    'roller.rolling_resistance': 0.1,
    'guide.upper_landing_m': 1e-3,
    'drive.stiffness_n_m': 0.1,
}


def place_with(*names):
    """Return a machine that has these tolerances."""
    stage = SimpleNamespace(
        knobs=[SimpleNamespace(name=name) for name in names], tolerances=TOLERANCES
    )
    return SimpleNamespace(stage=stage)


@pytest.fixture
def searched(monkeypatch):
    """Return a search over long waves in which what a size leaves is given; and what it tuned."""
    tuned = []

    def search(screen, after, without, turned=None, nothing=1e4):
        def left(one, of_none, of_size):
            return of_none if one is None else of_size(one.cause, *one.parameters.values())

        def at(one):
            tuned.append(one)
            return left(one, without, after), turned or {}

        monkeypatch.setattr(coarse, '_screened', lambda _, one: left(one, nothing, screen))
        monkeypatch.setattr(coarse, '_tuned', lambda _, one: at(one))
        afar = SimpleNamespace(place=place_with(*TOLERANCES))
        with ThreadPoolExecutor(1) as pool:
            return coarse_start(afar, pool), [t for t in tuned if t is not None]

    return search


def test_sizes_lie_either_way_within_the_laws_and_but_of_slow_tolerances(monkeypatch):
    monkeypatch.setattr(coarse, 'SHARES', (-100.0, *coarse.SHARES, 100.0))
    found = sizes_of(place_with(*TOLERANCES))
    assert {one.cause for one in found} == {
        'tensioner_stiffness', 'tensioner_preload', 'rolling_resistance', 'landing_length'
    }  # fmt: skip
    for one in found:
        (key, size), *_ = one.parameters.items()
        law = next(p for p in KNOWN[one.cause].parameters if p.name == key)
        assert law.low <= size <= law.high
    sizes = [one.parameters['delta_m'] for one in found if one.cause == 'landing_length']
    assert sizes == pytest.approx([-6e-3, -3e-3, 3e-3, 6e-3])
    assert {one.nuisance for one in found} < set(TOLERANCES)


def test_nothing_is_sought_that_has_no_tolerance_there():
    assert {one.cause for one in sizes_of(place_with(SPRING))} == {'tensioner_stiffness'}


def test_the_size_that_leaves_least_is_begun_with_and_has_its_own_tolerances_turn(searched):
    def left(cause, size):
        return 1e3 + (1e5 * (size - 0.8) ** 2 if cause == 'tensioner_preload' else 900.0)

    start, _ = searched(left, left, 2e3, {PRELOAD: -1.0})
    assert start.cause == 'tensioner_preload'
    assert start.parameters['factor'] == pytest.approx(0.75 * 0.98)  # a tolerance of 2 %


def test_only_two_sizes_of_a_cause_are_tuned_and_none_that_does_not_run(searched, monkeypatch):
    monkeypatch.setattr(coarse, 'MOST_TUNED', 5)

    def screen(cause, size):
        if cause == 'landing_length' and size < 0.0:
            return inf
        return {'tensioner_preload': 1.0, 'landing_length': 2.0}.get(cause, 3.0)

    _, tuned = searched(screen, lambda *_: 1e3, 2e3)
    assert len(tuned) == coarse.MOST_TUNED
    causes = [one.cause for one in tuned]
    assert causes.count('tensioner_preload') == causes.count('landing_length') == 2
    assert all(one.parameters.get('delta_m', 1.0) > 0.0 for one in tuned)


def test_of_sizes_that_hardly_run_those_that_do_are_tuned(searched):
    def screen(cause, size):
        return 1.0 if cause == 'rolling_resistance' and size > 1.0 else inf

    _, tuned = searched(screen, lambda *_: 1e3, 2e3)
    assert {one.cause for one in tuned} == {'rolling_resistance'}
    assert all(one.parameters['factor'] > 1.0 for one in tuned)


@pytest.mark.parametrize(('nothing', 'tunes'), [(1.2, True), (1.05, False)])
def test_where_no_size_shows_none_is_tuned_beside(searched, nothing, tunes):
    start, tuned = searched(lambda *_: 1.0, lambda *_: 1e3, 2e3, nothing=nothing)
    assert (start is not None) == bool(tuned) == tunes


@pytest.mark.parametrize(('without', 'fits'), [(2e3, True), (1.05e3, False)])
def test_what_leaves_hardly_less_than_no_effect_is_not_fitted(searched, without, fits):
    start, _ = searched(lambda *_: 1.0, lambda *_: 1e3, without)
    assert (start is not None) == fits


@pytest.mark.parametrize('dies', ['begun', 'tuned'])
def test_a_machine_that_does_not_run_ends_no_diagnosis(monkeypatch, dies):
    def die(*_, **__):
        raise ExperimentError('a chain that is too short')

    stage = SimpleNamespace(knobs=[], lean=lambda _: None)
    place = SimpleNamespace(stage=stage, model=None)
    monkeypatch.setattr(coarse, 'beside', die if dies == 'begun' else lambda *_, **__: place)
    monkeypatch.setattr(coarse.Descent, 'descend', die)
    afar = SimpleNamespace(context=None)
    assert coarse._tuned(afar, None) == (inf, {})
    if dies == 'begun':
        assert coarse._screened(afar, None) == inf


@pytest.mark.slow
@pytest.mark.timeout(570)
def test_a_preload_far_too_low_is_found_where_the_chain_swings_among_the_waves(
    monkeypatch, tmp_path
):
    monkeypatch.setenv(ANOTHER, str(LONGER / 'sheet.json'))
    case = Case(0.25, 1, 0.0, 3000.0)
    hidden = Effect('tensioner_preload', {}, {'factor': 0.8})
    # of set 251153, in which it was not named before
    order = Order(251_153_011, case, 125.0, (hidden,))
    write(make(order), tmp_path / 'bag', tmp_path / 'truth.json')
    machine = load_machine(LONGER / 'machine.yaml')
    recording = bagfile.read(tmp_path / 'bag', machine)
    context = prepare_tolerances(recording, machine, own_floor(machine), jobs=2)
    afar = Afar(context, beside(context, steps=0), [])
    with ThreadPoolExecutor(2) as pool:
        best = coarse_start(afar, pool)
    assert best.cause == 'tensioner_preload'
    # the machine's own is drawn too, of 2 %
    assert best.parameters['factor'] == pytest.approx(0.8, abs=0.05)
