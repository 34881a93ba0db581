"""Intervals: how far a size may be off to either side."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis import frames, spread
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Scores
from escalator_twin.diagnosis.telling import NORMAL_95, told

pytestmark = pytest.mark.issue(6)

SD = 0.01


def spring(nuisance='tensioner.stiffness_n_m', **more):
    proposal = Proposal(
        'tensioner_stiffness', {}, {'factor': 0.75}, 900.0, fitted=('factor',), nuisance=nuisance
    )
    return Found(proposal, 1.0, {'factor': SD}, 900.0, (), **more)


class Stage:
    """A stage whose chi squared is a given function of the spring's factor."""

    machine_length = 24.4

    def __init__(self, chi2, machine=None):
        self.chi2, self.machine = chi2, machine

    def fit(self, model):
        return model

    def lean(self, _model):
        return self

    def fit_shifted(self, model, _before):
        return model

    def run(self):
        (deviation,) = self.machine
        return deviation.parameters['factor']

    def judged(self, fitted, _cause):
        return self.chi2(fitted)


@pytest.mark.parametrize(
    ('chi2', 'below', 'above'),
    [
        (lambda x: ((x - 0.75) / SD) ** 2, 1.0, 1.0),  # as slopes have it
        (lambda x: ((x - 0.75) / (SD if x > 0.75 else 2.5 * SD)) ** 2, 2.5, 1.0),
        (lambda x: 9.0 * ((x - 0.75) / SD) ** 2, 1.0, 1.0),  # never told narrower
        (lambda x: 0.0 if x <= 0.75 else 100.0, 4.0, 1.0),  # flat as far as it is tried
        (lambda x: -5.0 if x > 0.75 else 0.0, 4.0, 4.0),  # lower elsewhere
    ],
)
def test_a_spread_is_wider_where_chi_squared_rises_less(monkeypatch, chi2, below, above):
    monkeypatch.setattr(spread, 'without_own', lambda stage, _: stage)
    monkeypatch.setattr(spread, 'apply', lambda _machine, deviations: deviations)
    monkeypatch.setattr(spread, 'replace', replaced)
    after = SimpleNamespace(stage=Stage(chi2), model=0.75)
    (found,) = spread.with_reach(SimpleNamespace(machine=None), after, [spring()], 1)
    assert found.reach['factor'] == pytest.approx((below * SD, above * SD))


def test_sizes_are_tried_beside_what_single_links_do_as_it_is(monkeypatch):
    """None is run at length with the link's effect in it."""
    link = Found(
        Proposal('link_stiffness', {'link': 3}, {'factor': 0.6}, 9.0, fitted=('factor',)),
        1.0, {'factor': SD}, 9.0, (),
    )  # fmt: skip

    class AtLength(Stage):
        def lean(self, model):
            assert model == 0.75
            return Stage(self.chi2)

        def run(self):
            raise AssertionError('run at length')

    monkeypatch.setattr(spread, 'without_own', lambda stage, _: stage)
    monkeypatch.setattr(spread, 'apply', lambda _machine, deviations: deviations)
    monkeypatch.setattr(spread, 'replace', replaced)
    after = SimpleNamespace(stage=AtLength(lambda x: ((x - 0.75) / (2.0 * SD)) ** 2), model=0.75)
    rows = [link, spring()]
    kept, found = spread.with_reach(SimpleNamespace(machine=None), after, rows, 1)
    assert kept is link
    assert found.reach['factor'] == pytest.approx((2.0 * SD, 2.0 * SD))


def replaced(thing, **changes):
    """Return a copy with changes, of a stage or of what was found."""
    if isinstance(thing, Stage):
        return type(thing)(thing.chi2, changes['machine'])
    return Found(**{**thing.__dict__, **changes})


def test_of_a_single_links_effect_slopes_are_kept():
    proposal = Proposal(
        'link_stiffness', {'link': 3, 'side': 'left'}, {'factor': 0.3}, 9.0, fitted=('factor',)
    )
    found = Found(proposal, 1.0, {'factor': SD}, 9.0, ())
    assert spread.with_reach(None, None, [found], 1) == [found]


def test_an_interval_holds_the_spread_to_either_side():
    row = told(spring(reach={'factor': (0.03, SD)}), 0.9)['parameters']['factor']
    plain = told(spring(), 0.9)['parameters']['factor']
    assert row['high'] == plain['high']
    assert row['low'] < plain['low'] - NORMAL_95 * 0.01


@pytest.mark.parametrize(('nuisance', 'own'), [('guide.upper_landing_m', 1e-3), (None, 5e-4)])
def test_what_is_added_to_the_machines_own_has_its_tolerance(nuisance, own):
    # by contracts.md a landing has a tolerance of a millimetre
    proposal = Proposal(
        'landing_length', {'which': 'upper'}, {'delta_m': 6e-3}, 9.0, nuisance=nuisance
    )
    row = told(Found(proposal, 1.0, {'delta_m': 0.0}, 9.0, ()), 0.9)['parameters']['delta_m']
    law = 0.02 * 6e-3
    half = NORMAL_95 * (own**2 + law**2) ** 0.5
    assert row['high'] - row['value'] == pytest.approx(half, rel=1e-6)
    assert trials.prototype().guide.landing_tol_m == 1e-3


@pytest.mark.parametrize(
    ('cause', 'key', 'value', 'off'),
    [
        # seed 151101, number 29: fitted, and hidden
        ('drive_ripple', 'cycles_per_pitch', 0.6046698, 0.6044797),
        ('drive_ripple', 'cycles_per_pitch', 0.2211468, 0.2212307),
    ],
)
def test_a_waves_length_is_off_by_more_than_the_fit_knows(cause, key, value, off):
    proposal = Proposal(cause, {}, {'relative_amplitude': 0.02, key: value}, 9.0)
    row = told(Found(proposal, 1.0, {key: 3.6e-5 * value}, 9.0, ()), 0.9)['parameters'][key]
    assert row['low'] < off < row['high']
    assert row['high'] - row['low'] < 2e-3 * value


def test_a_spots_depth_is_known_to_some_percent():
    # seed 141101, number 28: 0.6 mm
    proposal = Proposal('roller_flat', {'axle': 18, 'side': 'right'}, {'depth_m': 5.58e-4}, 9.0)
    row = told(Found(proposal, 1.0, {'depth_m': 1e-6}, 9.0, ()), 0.9)['parameters']['depth_m']
    assert row['low'] < 6e-4 < row['high'] < 6.3e-4


class Lines:
    """A stage in which a frame shows by lines of the pitch alone, near 7 Hz much alike from one line to the next."""

    PITCH_HZ = 0.57

    knobs = ()

    def __init__(self, explained):
        self.explained = explained

    def run(self, deviations=()):
        if not deviations:
            return np.zeros((1, 2))
        numbers = deviations[0].parameters
        off = (numbers['frequency_hz'] - 7.0) / self.PITCH_HZ
        angle = 2.0 * (off - round(off)) if abs(off) < 2.5 else 1.5
        strength = 4500.0 / numbers['modal_mass_kg']
        return strength * np.array([[np.cos(angle), np.sin(angle)]])

    def fit_shifted(self, model, _before):
        return model[0]

    def columns(self, changes, _cause):
        return changes[0]

    def judged(self, model, _cause):
        return 9000.0 + self.explained * float(np.sum((model - [1.0, 0.0]) ** 2))


def along(_rigid, column):
    """Return how much of a column is hidden."""
    return Scores(column[:1, 0] / np.sum(column**2), np.ones(1), np.ones(1))


@pytest.mark.parametrize('mass', [4500.0, 6000.0])
@pytest.mark.parametrize('explained', [4000.0, 30.0])
def test_a_frames_frequency_may_be_any_that_explains_nearly_as_much(monkeypatch, mass, explained):
    monkeypatch.setattr(frames, 'score_each', along)
    own = Proposal(
        'truss_resonance', {},
        {'frequency_hz': 7.0, 'damping_ratio': 0.02, 'modal_mass_kg': mass}, 9.0,
    )  # fmt: skip
    lines = Lines(explained)
    low, high = frames.possible_frequencies(lines, np.array([1.0, 0.0]), own)
    if explained < frames.NEARLY:  # any: nothing is told
        assert low < 1.05 * frames.LOWEST_HZ
        assert high > frames.HIGHEST_HZ / 1.05
    else:  # two lines on, and up to where the angle's sine squared is 0.15
        edge = 2.2 * lines.PITCH_HZ
        assert low == pytest.approx(7.0 - edge, abs=0.2)
        assert high == pytest.approx(7.0 + edge, abs=0.2)


@pytest.mark.parametrize('rattle', [0.0, 150.0, 1e6])
def test_where_rollers_rattle_a_frames_frequency_is_less_sure(monkeypatch, rattle):
    """Explained are 1000: 150 are open at least, twice what rattling moves, 500 at most."""
    own = Proposal(
        'truss_resonance', {},
        {'frequency_hz': 7.0, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}, 9.0,
    )  # fmt: skip
    monkeypatch.setattr(frames, 'score_each', along)
    monkeypatch.setattr(frames, 'rattling', lambda *_: rattle)
    still = Lines(1000.0)
    low, high = frames.possible_frequencies(still, np.array([1.0, 0.0]), own)
    open_to = min(max(150.0, 2.0 * rattle), 500.0)
    # of the last line that may be: its angle's sine squared is what is open
    edge = (2.0 + 0.5 * np.arcsin(np.sqrt(open_to / 1000.0))) * still.PITCH_HZ
    assert low == pytest.approx(7.0 - edge, abs=0.2)
    assert high == pytest.approx(7.0 + edge, abs=0.2)


@dataclass(frozen=True)
class Rattling:
    """A comparison that any turn of one tolerance moves by 40, of another by nothing."""

    turned: dict = field(default_factory=lambda: {'landing': 1.0})
    knobs: tuple = (SimpleNamespace(name='landing'), SimpleNamespace(name='mass'))

    def run(self, _deviations):
        return self.turned

    def fit_shifted(self, model, _before):
        return model

    def judged(self, turned, _cause):
        return 9000.0 - 40.0 * (turned['landing'] != 1.0)


def test_rattling_is_what_chi_squared_changes_by_for_next_to_nothing():
    own = Proposal('truss_resonance', {}, {'frequency_hz': 7.0}, 9.0)
    assert frames.rattling(Rattling(), {'landing': 1.0}, own) == pytest.approx(20.0)


def test_a_frame_of_another_damping_may_have_another_frequency(monkeypatch):
    """The frame hidden is damped as usual; the one fitted beside another line more."""

    class Damped(Lines):
        def run(self, deviations=()):
            model = super().run(deviations)
            if deviations and deviations[0].parameters['frequency_hz'] > 7.2:
                model = model * (1.0 if deviations[0].parameters['damping_ratio'] < 0.03 else -1.0)
            return model

    monkeypatch.setattr(frames, 'score_each', along)
    own = Proposal(
        'truss_resonance', {},
        {'frequency_hz': 7.0, 'damping_ratio': 0.05, 'modal_mass_kg': 4500.0}, 9.0,
    )  # fmt: skip
    _, high = frames.possible_frequencies(Damped(4000.0), np.array([1.0, 0.0]), own)
    assert high > 7.3


@pytest.mark.parametrize(('near', 'low', 'high'), [(None, 6.4, 7.1), ((6.1, 7.3), 6.1, 7.3)])
def test_a_frames_interval_holds_the_frequencies_that_it_may_have(monkeypatch, near, low, high):
    monkeypatch.setattr(spread, 'without_own', lambda stage, _: stage)
    monkeypatch.setattr(spread, 'apply', lambda _machine, deviations: deviations)
    monkeypatch.setattr(spread, 'replace', replaced)
    monkeypatch.setattr(spread, 'possible_frequencies', lambda *_: (6.4, 7.1))
    numbers = {'frequency_hz': 7.0, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}
    frame = Found(
        Proposal('truss_resonance', {}, numbers, 9.0),
        1.0,
        {'frequency_hz': 1e-3},
        9.0,
        (),
        near=near,
    )
    after = SimpleNamespace(stage=Stage(lambda _: 0.0), model=0.75)
    (found,) = spread.with_reach(SimpleNamespace(machine=None), after, [frame])
    row = told(found, 0.9)['parameters']['frequency_hz']
    assert low - 0.3 < row['low'] <= low
    assert high <= row['high'] < high + 0.3
