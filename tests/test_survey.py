"""The survey's error is taken out of the rail by what its spectrum tells."""

import numpy as np
import pytest

from escalator_twin.errors import MachineError
from escalator_twin.physics.survey import periodic_table, read_survey, without_error

pytestmark = pytest.mark.issue(3)


def rail(n=488, seed=0, steepness=3.0, size=3e-4):
    """Return a random rail whose waves fall with a power law, standard deviation ``size``."""
    rng = np.random.default_rng(seed)
    number = np.arange(1, n // 2 + 1)
    waves = np.zeros(n // 2 + 1, complex)
    waves[1:] = number ** (-steepness / 2.0) * np.exp(2j * np.pi * rng.random(n // 2))
    values = np.fft.irfft(waves, n)
    return values * size / values.std()


@pytest.mark.parametrize('seed', range(3))
def test_error_is_reduced_and_the_rail_kept(seed):
    truth = rail(seed=seed)
    error = 5e-5
    measured = truth + error * np.random.default_rng(100 + seed).standard_normal(len(truth))
    smooth = without_error(measured, error)
    assert np.std(smooth - truth) < 0.6 * error
    slope = np.std(np.diff(smooth - truth)) / np.std(np.diff(measured - truth))
    assert slope < 0.35


def test_exact_points_are_met():
    s = np.arange(488) * 0.05
    values = rail()
    table = periodic_table(s, values, 24.4)
    step = 24.4 / len(table)
    found = np.interp(s, np.arange(len(table)) * step, table[:, 0])
    assert found == pytest.approx(values, abs=1e-9)
    slope = np.gradient(table[:, 0], step)
    assert slope[1:-1] == pytest.approx(table[1:-1, 1], abs=2e-4)


def test_a_broken_survey_is_named(tmp_path):
    path = tmp_path / 'survey.csv'
    path.write_text('s,normal\n0.0,1\n')
    with pytest.raises(MachineError, match=r'survey\.csv: expected numeric columns'):
        read_survey(path)
    with pytest.raises(MachineError, match=r'guide\.survey_file'):
        read_survey(tmp_path / 'none.csv')
