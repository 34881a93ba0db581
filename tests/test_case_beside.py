"""What was set, told by a file beside a recording."""

from dataclasses import replace
import shutil

from makers import prototype, synthetic
import pytest

from escalator_twin import bagfile
from escalator_twin.comparison.locate import locate
from escalator_twin.errors import ExperimentError, RecordingError

pytestmark = pytest.mark.issue(3)

MACHINE = prototype()
ALL = 'speed: 0.25\ndirection: down\nload: 75\npreload: 6000\n'


@pytest.fixture(scope='module')
def recording():
    return synthetic(MACHINE, 10.0)


@pytest.fixture
def written(recording, tmp_path):
    """Return a function that writes the recording with an experiment, or without any."""

    def write(experiment):
        path = tmp_path / 'bag'
        bagfile.write(path, replace(recording, experiment=experiment), MACHINE, '/measured')
        return path

    return write


def test_a_recording_without_the_topic_has_what_the_file_says(written):
    path = written(None)
    assert bagfile.read(path, MACHINE).experiment is None
    (path / 'experiment.yaml').write_text(ALL)
    found = bagfile.read(path, MACHINE).experiment
    assert (found.set_speed_m_s, found.direction, found.preload_n) == (0.25, -1, 6000.0)
    assert set(found.load_per_step_kg) == {75.0}


def test_a_single_file_has_its_own(written):
    path = written(None)
    (file,) = path.glob('*.mcap')
    alone = shutil.copy(file, path.parent / 'run_7.mcap')
    (path.parent / 'run_7.experiment.yaml').write_text(ALL)
    (path.parent / 'experiment.yaml').write_text('nonsense: 1')  # of no file here
    assert bagfile.read(alone, MACHINE).experiment.set_speed_m_s == 0.25
    other = shutil.copy(file, path.parent / 'run_8.mcap')
    assert bagfile.read(other, MACHINE).experiment is None


def test_a_file_of_a_directory_has_the_directorys(written):
    path = written(None)
    (path / 'experiment.yaml').write_text(ALL)
    (file,) = path.glob('*.mcap')
    assert bagfile.read(file, MACHINE).experiment.set_speed_m_s == 0.25
    (path / f'{file.stem}.experiment.yaml').write_text(ALL.replace('0.25', '0.35'))
    assert bagfile.read(file, MACHINE).experiment.set_speed_m_s == 0.35


def test_what_the_file_says_wins_and_the_rest_is_the_recordings(recording, written):
    said = recording.experiment
    path = written(said)
    (path / 'experiment.yaml').write_text('load: 30\n')
    found = bagfile.read(path, MACHINE).experiment
    assert found == replace(said, load_per_step_kg=found.load_per_step_kg)
    assert set(found.load_per_step_kg) == {30.0}


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('speed: 0.5\nload: 0\n', 'missing: direction, preload'),
        (ALL.replace('down', 'left'), "direction: expected up or down, found 'left'"),
        (ALL + 'sped: 1\n', 'sped: unknown key'),
        ('a: [', 'not YAML'),
    ],
)
def test_a_file_that_cannot_be_used_is_told_by_its_name(written, text, reason):
    path = written(None)
    (path / 'experiment.yaml').write_text(text)
    with pytest.raises(ExperimentError, match=reason) as caught:
        bagfile.read(path, MACHINE)
    assert str(path / 'experiment.yaml') in str(caught.value)


def test_where_neither_tells_it_the_file_is_offered(written):
    with pytest.raises(RecordingError, match=r'experiment topic.*experiment\.yaml'):
        locate(bagfile.read(written(None), MACHINE), MACHINE)
