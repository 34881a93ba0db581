"""Rollers that are not round: what one loop's responses promise, the twin run with it keeps."""

import json

import pytest
from rig.hidden import plan, write_hidden
import trials

from escalator_twin import bagfile
from escalator_twin.diagnosis.floor import load_floor
from escalator_twin.diagnosis.preparation import prepare
from escalator_twin.diagnosis.search import Search
from escalator_twin.diagnosis.search_treads import eccentric, flats
from escalator_twin.diagnosis.view import View

pytestmark = pytest.mark.issue(6)

# By machine and cause drawn: slow, down, empty; up, empty and full; slow, up, full; down, full.
MADE = [
    (12, 'roller_flat', flats, 'depth_m'),
    pytest.param(3, 'roller_flat', flats, 'depth_m', marks=pytest.mark.long),
    pytest.param(4, 'roller_flat', flats, 'depth_m', marks=pytest.mark.long),
    pytest.param(5, 'roller_eccentricity', eccentric, 'amplitude_m', marks=pytest.mark.long),
    pytest.param(6, 'roller_eccentricity', eccentric, 'amplitude_m', marks=pytest.mark.long),
]
SEED = 60214


@pytest.mark.parametrize(('index', 'cause', 'family', 'key'), MADE)
def test_a_tread_is_found_with_size_and_phase_before_it_is_run(
    tmp_path, index, cause, family, key
):
    folder = tmp_path / 'made'
    write_hidden([plan(index, SEED, 1, [cause], ('reference',))], SEED, folder, 1)
    bag = next(path for path in folder.iterdir() if path.is_dir() and path.name != 'truth')
    machine = trials.prototype()
    context = prepare(bagfile.read(bag, machine), machine, load_floor(machine), jobs=2)
    place = context.place
    assert place is not None
    view = View.of(
        machine, place.stage.observation, context.responses, context.setting.experiment.direction
    )
    search = Search(view, place.fitted, place.stage, place.model, 2)
    best = max(family(search), key=lambda p: p.gain)
    (effect,) = json.loads((folder / 'truth' / f'{bag.name}.json').read_text())['effects']
    assert best.location == effect['location']
    assert best.parameters[key] == pytest.approx(effect['parameters'][key], rel=0.25)
    # a phase off by a tenth of a turn, or a slip by a twentieth of the grid's, would keep next to nothing
    stage = place.stage
    after = stage.judged(stage.fit(stage.run((best.deviation,))), cause)
    assert stage.judged(place.fitted, cause) - after == pytest.approx(best.gain, rel=0.15)
