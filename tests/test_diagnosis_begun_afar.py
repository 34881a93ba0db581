"""Fits that begin with no tolerance turned: what cannot be what is open is not begun."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import begun_afar
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = [pytest.mark.issue(6), pytest.mark.issue(7)]

EDGE = Proposal('landing_length', {'which': 'upper'}, {'delta_m': 2.4e-3}, 0.0)


@pytest.mark.parametrize('does', [True, False])
def test_an_edge_that_cannot_be_what_is_open_is_not_fitted(monkeypatch, does):
    monkeypatch.setattr(begun_afar, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain, model=None
    ))  # fmt: skip
    asked = []
    place = SimpleNamespace(stage=None, model=None, fitted=None)

    def reaches(_place, effect, _model, excess):
        asked.append((effect, excess))
        return does

    monkeypatch.setattr(begun_afar, 'at_reference', lambda effect: effect)
    monkeypatch.setattr(begun_afar, 'excess_of', lambda *_: 9e5)
    monkeypatch.setattr(begun_afar, 'reaches', reaches)
    monkeypatch.setattr(begun_afar, 'fitted_afar', lambda *given: given[3])
    afar = Afar(None, place, [], (EDGE,))
    pool = SimpleNamespace(map=map)
    found = begun_afar.at_edges(SimpleNamespace(floor=None), afar, place, [], [], pool, 1)
    assert [one.proposal for _, one in found] == ([EDGE] if does else [])
    assert asked == [(EDGE, 9e5)]
