"""Where a carriage rests: what a sensor of arbitrary zero leaves open of a stop."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import rest
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = pytest.mark.issue(6)

STOP = Proposal('tensioner_stop', {}, {'displacement_m': 5e-3}, 0.0, fitted=('displacement_m',))
DRAG = Proposal('tensioner_friction', {}, {'force_N': 100.0}, 0.0, fitted=('force_N',))


def test_whatever_fit_tells_a_stop_its_spread_holds_the_place_at_rest(monkeypatch):
    # two lengths, of which one standard deviation moves the carriage by 0.3 and 0.4 mm, beside a spring that
    # bends where the carriage swings and not where it rests
    moved = {'long': 3e-4, 'short': -4e-4, 'spring': 0.0}
    swing = np.array([-1e-3, 1e-3])
    knobs = {
        name: np.stack([np.full(2, 7.0), mean + swing * (name == 'spring')], axis=1)
        for name, mean in moved.items()
    }
    sensors = [SimpleNamespace(quantity=q) for q in ('link_force', 'carriage_displacement')]
    context = SimpleNamespace(
        machine=SimpleNamespace(instruments=SimpleNamespace(sensors=sensors)),
        nominal=None,
        responses=SimpleNamespace(knobs=knobs),
        setting=SimpleNamespace(experiment=None),
    )
    names = [SimpleNamespace(name=name) for name in (*moved, 'a rail')]
    monkeypatch.setattr(rest, 'knobs_of', lambda *_: names)
    precisions = np.diag([1e8, 4.0])  # 0.1 mm of the stop; 0.5 N
    monkeypatch.setattr(JointFit, 'products', lambda *_: (np.zeros(2), precisions))
    spreads = JointFit(context, (), None).spreads(None, (STOP, DRAG), None)
    assert spreads[0]['displacement_m'] == pytest.approx(np.hypot(1e-4, 5e-4))
    assert spreads[1] == {'force_N': pytest.approx(0.5)}
