"""The walk over rounds: what it accepts was run with the twin."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import walk as module
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.walk import Bench, walk

pytestmark = pytest.mark.issue(6)

MODE = {'modal_mass_kg': 9000.0, 'frequency_hz': 4.0, 'damping_ratio': 0.04}
FRAME = Proposal('truss_resonance', {}, MODE, 150.0, fitted=('modal_mass_kg',))
# chosen first, and in the end smaller than three of its tolerances
STEP = Proposal('guide_step', {'s_m': 11.4, 'side': 'both'}, {'height_m': -6e-5}, 900.0)


@pytest.mark.parametrize(('gain', 'accepted'), [(900.0, 1), (-400.0, 0)], ids=['holds', 'fails'])
def test_an_effect_that_was_not_chosen_is_run_before_it_is_accepted(monkeypatch, gain, accepted):
    runs = []

    def attempt(_context, _place, _known, chosen, *_):
        runs.append([p.cause for p in chosen])
        return [Tried(p, gain if p is FRAME else 3400.0, dict(p.sd)) for p in chosen]

    place = SimpleNamespace(stage=SimpleNamespace(turned={}))
    bench = Bench(
        propose=lambda *_: [STEP, FRAME],
        attempt=attempt,
        again=lambda context, *_: Polished(context, place, (), ()),
        bare=lambda place, _: place,
        decide=lambda *_: None,
        begin=lambda *_: {},
    )
    monkeypatch.setattr(module, 'freed', lambda place, _: place)
    monkeypatch.setattr(module, 'is_open', lambda *_: False)
    monkeypatch.setattr(module, 'excess_of', lambda *_: 0.0)
    monkeypatch.setattr(module, 'look_afar', lambda *_: None)
    context = SimpleNamespace(place=place, floor=None)
    found = walk(context, bench=bench).found
    assert runs == [['guide_step'], ['truss_resonance']]
    assert [f.proposal.cause for f in found] == ['truss_resonance'] * accepted


def test_an_effect_that_is_dropped_beside_a_later_one_costs_no_round(monkeypatch):
    friction = Proposal('tensioner_friction', {}, {'force_N': 180.0}, 9e4)
    step = Proposal('guide_step', {'s_m': 0.4, 'side': 'both'}, {'height_m': 8e-4}, 5e3)
    landing = Proposal('landing_length', {'which': 'upper'}, {'delta_m': 7e-3}, 4e3)
    gauge = Proposal('gauge_gain', {'link': 'right_b'}, {'factor': 1.06}, 2e3)
    rounds = [friction, step, landing, gauge]
    seen = []

    def propose(*_):
        seen.append(rounds[len(seen)])
        return [seen[-1]]

    def again(context, place, known, _):
        # beside the landing nothing is left of the rail's step
        kept = [
            replace(e, parameters={'height_m': 1e-7}) if e is step and landing in known else e
            for e in known
        ]
        return Polished(context, place, tuple(kept), tuple({} for _ in kept))

    place = SimpleNamespace(stage=SimpleNamespace(turned={}))
    bench = Bench(
        propose=propose,
        attempt=lambda _context, _place, _known, chosen, *_: [
            Tried(p, p.gain, dict(p.sd)) for p in chosen
        ],
        again=again,
        bare=lambda place, _: place,
        decide=lambda *_: None,
        begin=lambda *_: {},
    )
    monkeypatch.setattr(module, 'freed', lambda place, _: place)
    monkeypatch.setattr(module, 'is_open', lambda *_: True)
    monkeypatch.setattr(module, 'excess_of', lambda *_: 0.0)
    monkeypatch.setattr(module, 'look_afar', lambda *_: None)
    found = walk(SimpleNamespace(place=place, floor=None), bench=bench).found
    assert [f.proposal.cause for f in found] == [
        'tensioner_friction', 'landing_length', 'gauge_gain',
    ]  # fmt: skip


def test_one_gauge_creeps_once(monkeypatch):
    drift = Proposal('gauge_drift', {'link': 'right_a'}, {'strain': -9e-6, 'curvature': 3.5}, 9e3)
    again = replace(drift, parameters={'strain': -1e-6, 'curvature': 1.0}, gain=300.0)
    other = replace(drift, location={'link': 'left_b'}, gain=200.0)
    place = SimpleNamespace(stage=SimpleNamespace(turned={}))
    bench = Bench(
        propose=lambda *_: [drift, again, other],
        attempt=lambda *_: [],
        again=lambda context, place, known, _: Polished(
            context, place, tuple(known), tuple({} for _ in known)
        ),
        bare=lambda place, _: place,
        decide=lambda *_: None,
        begin=lambda *_: {},
    )
    monkeypatch.setattr(module, 'freed', lambda place, _: place)
    monkeypatch.setattr(module, 'is_open', lambda *_: True)
    monkeypatch.setattr(module, 'excess_of', lambda *_: 0.0)
    monkeypatch.setattr(module, 'look_afar', lambda *_: None)
    found = walk(SimpleNamespace(place=place, floor=None), bench=bench).found
    assert [f.proposal.location['link'] for f in found] == ['right_a', 'left_b']
