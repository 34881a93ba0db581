"""Tuning a good machine: as near to its recording as with the tolerances that it was made with."""

from dataclasses import dataclass
import json

import numpy as np
import pytest
from rig.hidden import plan, write_hidden
import trials

from escalator_twin import bagfile
from escalator_twin.diagnosis.context import beside, quiet_chi2
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.diagnosis.tuning import _doubted, KEPT_OFF, tuned
from escalator_twin.diagnosis.whitening import Whitener

pytestmark = pytest.mark.issue(6)

# Chi squared: what a coefficient more or less at the ends and the rails' columns make of it.
SPREAD = 150.0


def sigmas(truth, machine):
    """Return the generator's draws in standard deviations, by the twin's names."""
    drawn = truth['tolerances']
    by_name = {
        name: (drawn[key] - 1.0) / machine.tolerances[name]
        for name, key in {
            'chain.mass_per_pitch_kg': 'mass',
            'chain.link_stiffness_n_m': 'link_stiffness',
            'chain.link_damping_n_s_m': 'link_damping',
            'roller.contact_stiffness_n_m': 'contact_stiffness',
            'roller.rolling_resistance': 'rolling_resistance',
            'drive.stiffness_n_m': 'drive_stiffness',
            'tensioner.stiffness_n_m': 'tensioner_stiffness',
            'tensioner.damping_n_s_m': 'tensioner_damping',
        }.items()
    }
    landing = machine.guide.landing_tol_m
    return {
        **by_name,
        'guide.lower_landing_m': drawn['lower_landing_m'] / landing,
        'guide.upper_landing_m': drawn['upper_landing_m'] / landing,
        'experiment.preload_n': (drawn['preload'] - 1.0) / machine.tensioner.preload_tol,
        'experiment.load_per_step_kg': (drawn['load'] - 1.0) / machine.load.tol,
    }


# Of the floor's calibration set the one that a search by slopes alone leaves farthest off; and one whose
# contacts are 9 % stiffer, which moves a resonance: beside the shifts that the first model's alignment
# leaves, every other stiffness seemed worse.
@pytest.mark.slow
@pytest.mark.parametrize(
    ('seed', 'index', 'cause'),
    [
        pytest.param(71001, 10, 'clean', marks=pytest.mark.long),
        (131101, 20, 'mains_hum'),
    ],
)
def test_a_good_machine_is_tuned_as_near_as_its_own_tolerances(tmp_path, seed, index, cause):
    folder = tmp_path / 'made'
    write_hidden([plan(index, seed, 1, [cause], ('reference',))], seed, folder, 1)
    bag = next(path for path in folder.iterdir() if path.is_dir() and path.name != 'truth')
    machine = trials.prototype()
    context = prepare_tolerances(bagfile.read(bag, machine), machine, load_floor(machine), jobs=2)
    start = beside(context, steps=0)
    _, place = tuned(context, jobs=2, start=start)
    truth = json.loads((folder / 'truth' / f'{bag.name}.json').read_text())
    own = quiet_chi2(beside(context, steps=0, turned=sigmas(truth, machine)))
    assert quiet_chi2(start) > own + 5.0 * SPREAD, 'nothing to tune'
    assert quiet_chi2(place) < own + SPREAD


@dataclass(frozen=True)
class Lean:
    """A stage, as far as it says what is added to its runs."""

    whiten: Whitener
    added: np.ndarray | None


def test_what_is_kept_of_a_single_link_counts_as_known_to_a_share():
    n, sd = 100, 0.5  # a white sensor's, all of its band compared
    whiten = Whitener(np.ones((n, 1), np.float32), np.full((n, 1), 1.0 / sd, np.float32), 1.0)
    assert _doubted(Lean(whiten, None)).whiten is whiten
    added = np.zeros((n, 1))
    added[40:50] = 20.0 * sd
    mask = _doubted(Lean(whiten, added)).whiten.mask[:, 0]
    assert np.all(mask[:40] == 1.0)
    # noise and what is kept by mistake, together
    assert mask[40:50] == pytest.approx(1.0 / np.hypot(1.0, 20.0 * KEPT_OFF), rel=1e-5)
