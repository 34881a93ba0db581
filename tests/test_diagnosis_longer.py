"""Another machine of the prototype's kind, longer and heavier: described, and diagnosed with a borrowed error."""

import json
from pathlib import Path

import numpy as np
import pytest
from rig.catalogue import LISTED
from rig.draw import build, lay_rails, SURVEY_ERROR_M, Tolerances
from rig.machine import Case
from rig.make import Effect, make, Order, write
from rig.model import RECORD
from rig.places import loop_m
from rig.sheet import ANOTHER, chosen, Sheet

from benchmarks.scoring import judge, Truth
from escalator_twin import pipeline
from escalator_twin.machine import load_machine
from escalator_twin.physics.path import build_path
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation, run_twin

pytestmark = [pytest.mark.issue(6), pytest.mark.issue(7)]

LONGER = Path(__file__).parent / 'data' / 'longer'
CASE = Case(0.5, -1, 0.0, 6000.0)
HIDDEN = Effect('roller_eccentricity', {'axle': 41, 'side': 'left'}, {'amplitude_m': 4e-4})


@pytest.fixture
def longer(monkeypatch):
    monkeypatch.setenv(ANOTHER, str(LONGER / 'sheet.json'))


def test_the_prototype_is_made_where_no_other_machine_is_named(monkeypatch):
    monkeypatch.delenv(ANOTHER, raising=False)
    assert chosen() == Sheet()


@pytest.mark.usefixtures('longer')
def test_generator_and_twin_are_told_of_the_same_machine():
    sheet, machine = chosen(), load_machine(LONGER / 'machine.yaml')
    assert sheet != Sheet()
    told = [
        (sheet.links, machine.chain.n_links),
        (sheet.axle_mass_kg, machine.chain.mass_per_pitch_kg),
        (sheet.link_stiffness_n_m, machine.chain.link_stiffness_n_m),
        (sheet.racking_stiffness_n_m, machine.chain.racking_stiffness_n_m),
        (sheet.roller_diameter_m, machine.roller.diameter_m),
        (sheet.contact_stiffness_n_m, machine.roller.contact_stiffness_n_m),
        (sheet.rolling_resistance, machine.roller.rolling_resistance),
        (sheet.viscous_drag_ns_m, machine.roller.viscous_drag_n_s_m),
        (sheet.clearance_m, machine.guide.channel_clearance_m),
        (sheet.drive_start_m, machine.drive.start_m),
        (sheet.drive_length_m, machine.drive.length_m),
        (sheet.drive_stiffness_n_m, machine.drive.stiffness_n_m),
        (sheet.carriage_mass_kg, machine.tensioner.mass_kg),
        (sheet.tensioner_stiffness_n_m, machine.tensioner.stiffness_n_m),
        (sheet.tensioner_damping_ns_m, machine.tensioner.damping_n_s_m),
        (sheet.load_to_m, machine.load.to_m),
        (sheet.lateral_stiffness_n_m, machine.lateral.stiffness_n_m),
    ]
    assert all(own == other for own, other in told)
    assert sheet.rise_m == pytest.approx(machine.guide.rise_m, abs=1e-9)
    survey = machine.source.parent / machine.guide.survey_file
    assert Path(sheet.survey).read_bytes() == survey.read_bytes()


@pytest.mark.usefixtures('longer')
def test_the_machine_runs_on_the_rails_that_its_survey_says():
    sheet = chosen()
    model = lay_rails(build(sheet, CASE, 0.5, Tolerances()), None)
    survey = np.loadtxt(sheet.survey, delimiter=',', skiprows=1)
    there = np.interp(survey[:, 0], model.cell * np.arange(model.lateral.size), model.normal[0])
    # the likeliest rail: the survey less what is its error
    assert np.std(there - survey[:, 1]) < 2.0 * SURVEY_ERROR_M < 0.5 * np.std(survey[:, 1])


@pytest.mark.usefixtures('longer')
def test_places_are_drawn_on_all_of_it():
    rng, machine = np.random.default_rng(3), load_machine(LONGER / 'machine.yaml')
    length_m = build_path(machine.guide).length_m
    assert length_m - 0.1 < loop_m() <= length_m
    drawn = [LISTED['guide_step'].draw(rng, 1.0)[0]['s_m'] for _ in range(300)]
    assert loop_m() - 0.5 < max(drawn) <= loop_m()
    axles = {LISTED['roller_drag'].draw(rng, 1.0)[0]['axle'] for _ in range(1000)}
    assert axles == set(range(machine.chain.n_links))


@pytest.mark.usefixtures('longer')
def test_its_carriage_stands_where_the_generator_has_it():
    made = make(Order(5, Case(0.5, -1, 0.0, 3000.0), 20.0, is_nominal=True, start_s_m=3.0))
    machine = load_machine(LONGER / 'machine.yaml')
    simulation = make_simulation(machine, Experiment(made.truth['speed_m_s'], -1, (0.0,), 3000.0))
    trace = run_twin(simulation, machine.instruments.sensors, 3.0, 20.0, 200.0)
    at = [s.channel for s in machine.instruments.sensors].index('tensioner/displacement')
    own, other = trace.columns[:, at], made.rows[:, RECORD.index('u')]
    assert made.truth['loop_m'] == pytest.approx(build_path(machine.guide).length_m, abs=0.01)
    # a tenth of what the prototype's rails would make of it
    assert own.mean() == pytest.approx(other.mean(), abs=5e-5)
    assert own.std() == pytest.approx(other.std(), rel=0.01)


@pytest.mark.slow
@pytest.mark.timeout(570)
@pytest.mark.usefixtures('longer')
def test_an_eccentric_roller_of_the_longer_machine_is_named_in_its_place(tmp_path):
    bag = tmp_path / 'bag'
    made = make(Order(60_609, CASE, 85.0, (HIDDEN,)))
    write(made, bag, tmp_path / 'truth.json')
    extended = tmp_path / 'extended.yaml'
    verdict = pipeline.diagnose([str(bag)], LONGER / 'machine.yaml', jobs=2, out=extended)
    outcome = judge(Truth.of(json.loads((tmp_path / 'truth.json').read_text())), verdict)
    assert outcome.cause_right
    assert outcome.place_right
    assert all(outcome.covered)
    assert len(verdict['effects']) == 1
