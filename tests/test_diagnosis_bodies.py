"""The second machine is diagnosed by the same command; truths are read after the verdict."""

from dataclasses import replace
import json
from pathlib import Path

from belt.chain import Chain, read_sheet
from belt.good import draw, hide, tolerances
import kwons
import numpy as np
import pytest
import yaml

from escalator_twin.cli.main import main
from escalator_twin.diagnosis.bodies.context import mean_spread
from escalator_twin.diagnosis.bodies.everywhere import at_index, run_everywhere
from escalator_twin.diagnosis.bodies.gears import MARGIN_M, on_gear
from escalator_twin.diagnosis.diagnose import diagnose_recording
from escalator_twin.diagnosis.floor import Floor, Level, read_floor, write_floor
from escalator_twin.diagnosis.loops import Frame
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.errors import NotYetError
from escalator_twin.machine import Deviation, load_machine
from escalator_twin.physics.course import course_of
from escalator_twin.physics.multibody.guide import chain_track
from escalator_twin.physics.multibody.segments import LENGTH
from escalator_twin.signals import Recording

pytestmark = pytest.mark.issue(8)

KWON = kwons.MACHINES / 'kwon.yaml'
DURATION_S = 30.0
# seed and size; the floor is of seeds 100 to 102
HIDDEN = {'gear_eccentricity': (201, 1e-3)}
GOOD = 103


@pytest.fixture(scope='session')
def small(tmp_path_factory) -> Path:
    """Return the description of a machine of this kind that is cheap to run."""
    return kwons.write_small(tmp_path_factory.mktemp('small'))


def diagnosed(folder, seed, hidden):
    """Return the verdict of the command, then the truth."""
    bag, truth, told = folder / 'bag', folder / 'truth' / 'bag.json', folder / 'told.json'
    hide(bag, truth, KWON, seed, hidden, DURATION_S)
    words = ['diagnose', str(bag), '--machine', str(KWON), '--json', str(told), '--jobs', '2']
    assert main(words) == 0
    verdict = json.loads(told.read_text(encoding='utf-8'))
    return verdict, json.loads(truth.read_text(encoding='utf-8'))['effects']


def agrees(verdict, truth):
    """Hold a verdict against the one effect that was hidden."""
    (effect,), (hidden,) = verdict['effects'], truth
    assert effect['cause'] == hidden['cause']
    assert len(effect['alternatives']) <= 2
    for key, value in hidden['location'].items():
        assert effect['location'][key] == value
    for name, value in hidden['parameters'].items():
        interval = effect['parameters'][name]
        assert interval['low'] <= value <= interval['high']
    return effect


@pytest.mark.long
@pytest.mark.parametrize('cause', HIDDEN)
def test_a_hidden_cause_is_named_with_its_size(tmp_path, monkeypatch, cause):
    monkeypatch.chdir(tmp_path)
    seed, size = HIDDEN[cause]
    verdict, truth = diagnosed(tmp_path, seed, {cause: size})
    agrees(verdict, truth)
    extended = load_machine(verdict['extended_machine'])
    assert [d.cause for d in extended.deviations] == [cause]


@pytest.mark.long
def test_within_tolerance_nothing_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    verdict, _ = diagnosed(tmp_path, GOOD, {})
    assert verdict['effects'] == []
    description = yaml.safe_load(Path(verdict['extended_machine']).read_text(encoding='utf-8'))
    assert description['deviations'] == []


def test_without_the_twins_own_error_nothing_is_diagnosed():
    with pytest.raises(NotYetError, match='error was not measured'):
        diagnose_recording(Recording('bag', {}), replace(kwons.kwon(), source=Path('kwon.yaml')))


def test_the_generator_draws_machines_within_their_tolerances():
    path = kwons.MACHINES / 'kwon.yaml'
    designed = read_sheet(path)
    ratios = []
    for seed in range(200):
        sheet, may = draw(path, np.random.default_rng(seed))
        ratios.append(
            [
                (sheet[part][key] / designed[part][key] - 1.0) / tolerance
                for (part, key), tolerance in tolerances(path).items()
            ]
        )
        assert may['tensioner_friction'] >= 0.0
    assert np.std(ratios, axis=0) == pytest.approx(1.0, abs=0.2)
    assert np.mean(ratios, axis=0) == pytest.approx(0.0, abs=0.3)


def test_the_generator_keeps_what_it_hides(small):
    sheet = read_sheet(small)
    plain, drag = Chain(sheet), Chain(sheet, {'roller_drag': 120.0, 'roller_drag_axle': 9})
    assert plain.drags.sum() == 0.0
    assert drag.drags[9] == 120.0


@pytest.mark.long
@pytest.mark.slow
def test_one_run_stands_for_a_cause_at_every_axle(small):
    machine = load_machine(small)
    experiment, length = machine.default_experiment(), course_of(machine).length_m
    frame = Frame.of(machine, experiment.set_speed_m_s)

    def response(axle):
        place = {'axle': axle, 'side': 'both'}
        drag = Deviation('roller_drag', {'force_N': 120.0}, place)
        run = run_everywhere(machine, experiment, length, (drag,))
        return run.on_loop(frame) - plain.on_loop(frame)

    plain = run_everywhere(machine, experiment, length)
    channels = ('chain/tension', 'gear/torque')
    index = np.arange(frame.n_loop)
    nothing = np.zeros((len(index), len(channels)))
    seen = Observation(frame, channels, index, nothing, nothing, nothing == 0.0, 0.0)
    by_shift = at_index(response(0), plain.blocks, seen, machine, 1, 7)
    directly = at_index(response(7), plain.blocks, seen, machine, 1, 0)
    for k in range(len(channels)):
        assert np.corrcoef(by_shift[:, k], directly[:, k])[0, 1] > 0.99


def test_a_floor_keeps_its_means(tmp_path):
    smooth, lines = np.ones(8), np.zeros(32)
    levels = {'gear_torque': {0.5: Level(smooth, lines, (-1.5, 2.0))},
              'link_force': {0.5: Level(smooth, lines)}}  # fmt: skip
    leans = {'chain_elongation': 8e-5}
    floor = Floor(levels, (-0.1, 0.3), leans=leans)
    write_floor(tmp_path / 'floor.yaml', floor, 'a test')
    found = read_floor(tmp_path / 'floor.yaml')
    assert found.clean == (-0.1, 0.3)
    assert found.leans == leans
    assert found.levels['gear_torque'][0.5].mean == (-1.5, 2.0)
    assert found.mean_of(kwons.kwon().instruments.sensor('chain/tension'), 0.5) is None


def test_a_roller_is_on_a_gear_where_its_track_bends_back():
    machine = kwons.kwon()
    track = chain_track(machine)
    place = np.linspace(0.0, track.length_m, 5000, endpoint=False)
    turn = track.rows[[5, 8], LENGTH].sum()  # upper and lower gear
    share = (turn + 4.0 * MARGIN_M) / track.length_m
    assert on_gear(machine, place).mean() == pytest.approx(share, abs=2e-3)
    assert not on_gear(machine, np.array([0.3, 4.0])).any()  # lower landing, incline


def test_a_mean_is_as_sure_as_its_zero_and_gain_let_it():
    torque = kwons.kwon().instruments.sensor('gear/torque')
    sure = mean_spread(torque, 0.0, 180.0)
    assert sure == pytest.approx(np.hypot(5.0 / 3.0**0.5, 0.005 * 180.0))
    assert mean_spread(torque, 40.0, 0.0) == pytest.approx(40.0)
