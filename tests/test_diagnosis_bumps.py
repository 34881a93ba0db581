"""A bump of the rail: what is run at one place stands for those beside it, and all round the loop."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import search_rails
from escalator_twin.diagnosis.bumps import Bump, Bumps, mirrored
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.search import Search
from escalator_twin.diagnosis.whitening import Whitener

pytestmark = pytest.mark.issue(6)

LENGTH_M, SAMPLES, FRAME = 12.0, 900, Frame(0.4, 30, 40, 0.5)
CHANNELS = ('force/left', 'force/right', 'step/y', 'step/z')
BUMP = Bump(1.0e-3, 0.06, is_low=True)


class Instruments:
    """Two gauges and a step's accelerometer."""

    def sensor(self, channel):
        kind, which = channel.split('/')
        at = {'side': which, 'link': 0} if kind == 'force' else {'step': 0, 'axis': which}
        return SimpleNamespace(quantity=kind, at=at)


def rung(place, height, direction):
    """Return what rollers that pass a bump on the left ring with: a chirp for each pitch of travel."""
    travel = FRAME.spacing_m * np.arange(SAMPLES)
    since = (
        (direction * travel - place) % FRAME.pitch_m * direction % FRAME.pitch_m / FRAME.pitch_m
    )
    wave = np.sin(2.0 * np.pi * 3.0 * since**2) * np.sin(np.pi * since) ** 2
    # a gauge sees it ebb away from the bump; the other side half as much, y turned round
    near = np.exp(-((((direction * travel - place + 6.0) % LENGTH_M) - 6.0) ** 2) / 8.0)
    return height * wave[:, None] * near[:, None] * np.array([1.0, 0.5, -0.3, 0.2])


def beside(measured, direction, excess=np.inf):
    """Return a search that runs such bumps, beside what was measured."""
    whiten = Whitener(
        np.ones((SAMPLES, len(CHANNELS)), np.float32),
        np.full((SAMPLES, len(CHANNELS)), 1e5, np.float32),
        1.0,
    )
    machine = SimpleNamespace(instruments=Instruments())
    observation = SimpleNamespace(frame=FRAME, channels=CHANNELS)
    view = SimpleNamespace(
        observation=observation,
        direction=direction,
        responses=SimpleNamespace(base=SimpleNamespace(length_m=LENGTH_M)),
        place_of=lambda _: (direction * FRAME.spacing_m * np.arange(SAMPLES)) % LENGTH_M,
    )
    runs = []

    def run(deviations):
        (one,) = deviations
        runs.append(one)
        return rung(one.location['s_m'], one.parameters['height_m'], direction)

    def left(model):
        white = whiten((measured - model)[:, :, None])[:, 0]
        # a nuisance like no bump: it takes next to nothing
        column = np.random.default_rng(1).normal(size=(len(white), 1)).astype(np.float32)
        return fit(white, column, np.zeros(1))

    stage = SimpleNamespace(
        machine=machine, machine_length=LENGTH_M, whiten=whiten, run=run, fit=left,
        judged=lambda fitted, _: fitted.chi2,
    )  # fmt: skip
    fitted = left(np.zeros_like(measured))
    none = np.zeros_like(measured)
    return Search(view, fitted, stage, none, jobs=1, is_open=True, excess=excess), runs


@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
@pytest.mark.parametrize('side', ['left', 'right', 'both'])
def test_a_run_beside_a_bump_tells_its_place_side_and_height(direction, side):
    at, height = 5.137, 0.8e-3
    search, _ = beside(np.zeros((SAMPLES, 4)), direction)
    left = rung(at, height, direction)
    right = mirrored(search, left)
    measured = {'left': left, 'right': right, 'both': left + right}[side]
    search, runs = beside(measured, direction)
    found = Bumps.beside(search, 0.1).at(5.08, BUMP, 0.1)
    assert [one.location['s_m'] for one in runs] == [5.08]
    best = max(found, key=lambda p: p.gain)
    assert best.location['side'] == side
    assert best.location['s_m'] == pytest.approx(at, abs=2e-3)
    assert best.parameters['height_m'] == pytest.approx(height, rel=0.03)
    assert best.gain == pytest.approx(search.fitted.chi2, rel=0.05)


def test_no_bump_is_run_or_told_beyond_the_path_of_a_machine_that_tolerances_make_shorter():
    """Landings 0.9 mm shorter ended a diagnosis: a place 0.7 mm before the design's end was none."""
    search, runs = beside(rung(LENGTH_M - 0.003, 1e-3, 1), 1)
    bumps = Bumps.beside(search, 0.1)
    told = [
        one.location['s_m'] for at in (-0.001, LENGTH_M - 0.002) for one in bumps.at(at, BUMP, 0.1)
    ]
    places = [*told, *(one.location['s_m'] for one in runs)]
    assert max(places) > LENGTH_M - 0.1
    assert all(0.0 <= place <= LENGTH_M - 0.01 for place in places)


@pytest.mark.parametrize('is_low', [True, False], ids=['low', 'high'])
@pytest.mark.parametrize(
    ('height', 'told', 'low'),
    [(3.0, 1.4, 1.4), (1.2, 1.2, 1.2), (0.3, 0.7, 0.3), (-0.6, 0.7, -0.6), (-3.0, 0.7, -1.4)],
)
def test_a_run_speaks_for_heights_near_its_own_and_a_low_one_for_all_below(
    is_low, height, told, low
):
    """In mm; of a wave so many times as high as what is read of it the rest is left."""
    search, _ = beside(rung(5.1, height * 1e-3, 1), 1)
    bump = Bump(1.0e-3, 0.06, is_low=is_low)
    found = Bumps.beside(search, 0.1).at(5.08, bump, 0.1)[0]
    read = low if is_low else told
    explained = 1.0 - (1.0 - read / height) ** 2
    if explained < 0.0:  # elsewhere it explains a little
        assert found.parameters['height_m'] >= 0.7e-3 * 0.999
        assert found.gain < 0.5 * search.fitted.chi2
        return
    assert found.parameters['height_m'] == pytest.approx(read * 1e-3, rel=0.03)
    assert found.location['s_m'] == pytest.approx(5.1, abs=2e-3)
    assert found.gain == pytest.approx(explained * search.fitted.chi2, rel=0.05)


@pytest.mark.parametrize(
    ('share', 'is_sought'), [(0.5, False), (2.0, True)], ids=['explained', 'open']
)
def test_what_the_step_does_not_show_is_sought_all_round_the_loop(monkeypatch, share, is_sought):
    # the step's own acceleration points elsewhere
    monkeypatch.setattr(search_rails, '_starts', lambda *_: [1.0])
    at = 7.9
    measured = rung(at, 0.5e-3, 1) + rung(1.0, 0.4e-3, 1)
    search, runs = beside(measured, 1)
    explained = max(p.gain for p in Bumps.beside(search, 0.1).at(1.0, BUMP, 0.1))
    search, runs = beside(measured, 1, excess=share * explained / search_rails.ENOUGH)
    found = list(search_rails.rail_steps(search))
    places = {round(p.location['s_m'], 2) for p in found if p.location['side'] == 'left'}
    assert (at in places) == is_sought
    tried = {round(one.location['s_m'], 3) for one in runs}
    assert (len(tried) >= round(LENGTH_M / search_rails.ROUND_M)) == is_sought


def test_without_a_steps_acceleration_a_bump_is_sought_by_the_rollers_alone(monkeypatch):
    sound = Instruments.sensor
    monkeypatch.setattr(
        Instruments, 'sensor', lambda self, name: sound(self, name.replace('/z', '/x'))
    )
    search, _ = beside(rung(7.9, 0.5e-3, 1), 1)
    best = max(search_rails.rail_steps(search), key=lambda p: p.gain)
    assert best.location == {'s_m': pytest.approx(7.9, abs=2e-3), 'side': 'left'}


def test_all_round_looks_where_no_run_has_been_read_however_near():
    # a run is read 3.5 cm to either side
    search, _ = beside(rung(7.9, 0.5e-3, 1), 1)
    bumps = Bumps.beside(search, 0.1)
    for known, is_new in ((7.75, True), (7.88, False)):
        first = search_rails._all_round(bumps, [known])[0]
        assert (abs(first - 7.9) < 0.02) == is_new


def a_bump(height_mm, gain, side='right'):
    numbers = {'height_m': height_mm * 1e-3, 'length_m': 0.06}
    return Proposal('guide_step', {'s_m': 5.0, 'side': side}, numbers, gain)


class AsRun:
    """A stage on which what a bump leaves of 1000 hangs on its height, in mm."""

    def __init__(self, explained):
        self.explained, self.ran = explained, []

    def run(self, deviations):
        (one,) = deviations
        self.ran.append((one.location['side'], round(one.parameters['height_m'] * 1e3, 3)))
        return self.ran[-1][1]

    def fit(self, height_mm):
        return 1000.0 - self.explained(height_mm)

    def judged(self, left, cause):
        assert cause == 'guide_step'
        return left


def test_of_every_height_the_best_is_run_as_it_is():
    """What runs of another height promise of 0.9 mm does not hold: there rollers leave their track."""
    stage = AsRun(lambda mm: {0.5: 600.0, 0.9: 100.0, 1.5: 750.0}[mm])
    search = SimpleNamespace(stage=stage, fitted=1000.0, jobs=1)
    said = [(0.9, 900.0), (0.92, 890.0), (1.5, 800.0), (1.52, 790.0), (0.5, 700.0), (-0.5, 300.0)]
    (found,) = search_rails._as_run(search, [a_bump(*one) for one in said])
    assert (found.parameters['height_m'], found.gain) == (1.5e-3, 750.0)
    # not what is far behind, and of two heights near each other one
    assert sorted(stage.ran) == [('right', 0.5), ('right', 0.9), ('right', 1.5)]


def test_a_bump_that_explains_next_to_nothing_is_not_run():
    search = SimpleNamespace(stage=AsRun(None), fitted=1000.0, jobs=1)
    one = a_bump(0.1, 40.0)
    assert search_rails._as_run(search, [one]) == [one]


@pytest.mark.parametrize(('ran', 'kept'), [(400.0, [1.5, 0.9]), (300.0, [1.5]), (800.0, [0.9])])
def test_what_promises_most_is_proposed_as_well_where_it_holds_half_of_that(ran, kept):
    stage = AsRun(lambda mm: {0.9: ran, 1.5: 750.0}[mm])
    search = SimpleNamespace(stage=stage, fitted=1000.0, jobs=1)
    found = search_rails._as_run(search, [a_bump(1.5, 700.0), a_bump(0.9, 780.0)])
    assert [round(p.parameters['height_m'] * 1e3, 3) for p in found] == kept


def test_heights_of_either_sign_are_apart():
    bands = [search_rails._band(h * 1e-3) for h in (-1.5, -0.5, -0.05, 0.05, 0.5, 0.52, 1.5)]
    assert len(set(bands)) == 6
    assert bands[4] == bands[5]


def test_shapes_about_every_side_that_is_close_are_run(monkeypatch):
    runs = []

    def run(_bumps, some, _reach):
        runs.append(list(some))
        said = (('left', 0.9, 900.0), ('right', 1.5, 800.0), ('both', 0.5, 600.0))
        return [a_bump(height, gain, side) for side, height, gain in said]

    monkeypatch.setattr(search_rails, '_run', run)
    search_rails._shapes(SimpleNamespace(), [a_bump(1.0, 100.0)])
    heights = {round(shape.height_m * 1e3, 3) for _, shape in runs[1]}
    assert {0.9, 1.5} <= heights
    assert 0.5 not in heights
    assert len(runs[1]) == len(set(runs[1])) <= 30


def test_trials_that_lead_to_one_place_are_one():
    def trial(at, gain):
        return [Proposal('guide_step', {'s_m': at, 'side': 'left'}, {}, g) for g in (gain, 1.0)]

    rows = [trial(11.99, 700.0), trial(5.0, 800.0), trial(0.02, 900.0), trial(5.1, 850.0)]
    found = search_rails._best_apart(rows, LENGTH_M)
    assert [[p.gain for p in one] for one in found] == [
        [900.0, 1.0, 700.0, 1.0],
        [850.0, 1.0, 800.0, 1.0],
    ]
