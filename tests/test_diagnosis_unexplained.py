"""What is left is judged against what the effects explain, whoever took it before."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import unexplained
from escalator_twin.diagnosis.floor import Floor

pytestmark = pytest.mark.issue(6)

LEVEL, LIMIT = np.ones(2), np.full(2, 1.2)
SHAKEN = 1e4  # of chi squared, above a good machine's


def place(energy, chi2):
    stage = SimpleNamespace(judged=lambda _: chi2, quiet=np.array([True, False]))
    return SimpleNamespace(energy=np.array(energy), stage=stage, fitted=None)


@pytest.fixture
def explained(monkeypatch):
    monkeypatch.setattr(unexplained, 'by_channel', lambda p: p.energy)
    monkeypatch.setattr(unexplained, 'levels_of', lambda *_: LEVEL)
    monkeypatch.setattr(unexplained, 'limits_of', lambda *_: LIMIT)
    monkeypatch.setattr(
        unexplained, 'excess_of', lambda *_, shaken=False: SHAKEN if shaken else 200.0
    )
    monkeypatch.setattr(unexplained, 'signature_of', lambda *_: {})
    context = SimpleNamespace(floor=Floor({}))

    def told(before, after):
        return unexplained.look(context, place(*before), place(*after)).explained

    return told


def test_what_no_nuisance_had_taken_counts_by_energy(explained):
    assert explained(([5.0, 1.0], 1000.0), ([2.0, 1.0], 1000.0)) == pytest.approx(0.75)


def test_what_a_gauges_own_nuisance_had_taken_counts_by_what_that_took(explained):
    # the same is left with and without the effect, but its size was no good gauge's
    assert explained(([1.2, 1.0], 1000.0), ([1.2, 1.0], 400.0)) == pytest.approx(0.75)


@pytest.mark.parametrize(
    ('fell', 'rattle', 'counts'), [(600, 1.1, True), (600, 9.0, False), (1200, 9.0, True)]
)
def test_what_falls_by_little_beside_open_rattling_is_no_part_of_what_is_open(
    explained, fell, rattle, counts
):
    """It is told by energy alone: none of it here."""
    told = explained(([1.0, rattle], 2000.0), ([1.0, rattle], 2000.0 - fell))
    assert told == pytest.approx(fell / (fell + 200.0) if counts else 0.0)


def test_an_effect_that_explains_nothing_explains_nothing(explained):
    assert explained(([1.2, 1.0], 1000.0), ([1.2, 1.0], 1000.0)) == 0.0


@pytest.mark.parametrize(
    ('name', 'size', 'is_stretched', 'is_used_up'),
    [
        ('link_force/a/gain', -3.5, True, False), ('rotation/x', 3.5, True, False),
        ('link_force/a/gain', 2.5, False, False), ('link_force/a/zero', 40.0, False, False),
        ('roller.rolling_resistance', 3.5, False, True),
        ('roller.rolling_resistance', 2.5, False, False),
        ('roller.contact_stiffness_n_m', 3.5, False, False),  # no cause's tolerance
    ],
)  # fmt: skip
def test_what_is_beyond_its_tolerance_is_told(name, size, is_stretched, is_used_up):
    nuisance = SimpleNamespace(names=('course', name, 'effect/2'))
    stage = SimpleNamespace(nuisance=nuisance)
    # a tolerance is turned in the run, and fitted beyond that
    for turned in (0.0, 0.6 * size):
        fitted = SimpleNamespace(
            sizes=np.array([9.0, size - turned]), offset=np.array([0.0, turned])
        )
        held = SimpleNamespace(stage=stage, fitted=fitted)
        assert unexplained.is_stretched(held) is is_stretched
        assert unexplained.is_used_up(held) is is_used_up
        assert not unexplained.is_used_up(held, {name})  # an accepted effect stands for it
