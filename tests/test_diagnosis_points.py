"""What tolerances do in a fit of several recordings: run with effects of single links, once."""

from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from searches import CHAIN, LINK

from escalator_twin.diagnosis import points
from escalator_twin.diagnosis.points import moved_from, Point, Runs

pytestmark = pytest.mark.issue(7)


@dataclass(frozen=True)
class Fit:
    """Tells what it was asked for."""

    asked: list[tuple[Any, ...]] = field(default_factory=list)

    def taken_whole(self, place, effects, _jobs):
        self.asked.append(('whole', place, tuple(e.cause for e in effects)))
        return self

    def by_secant(self, before, _effects, turned):
        self.asked.append(('secant', before, turned))
        return self


class Machine(Runs):
    """Stands where its tolerance is."""

    def __init__(self):
        super().__init__(None)

    def each(self, do, *rows):
        return list(map(do, *rows))

    def run(self, point):
        return replace(point, places=(point.turned.get(('mass',), 0.0),), levels=(1.0,))


def point_of(own, fit):
    return Machine().run(Point((fit,), (own,), (CHAIN,), {}))


def at(mass):
    return {('mass',): mass}


def test_beside_a_link_they_are_run_once_with_it_and_then_corrected_by_every_step():
    fit, runs = Fit(), Machine()
    first = runs.taken_anew(point_of((LINK,), fit))
    second = runs.taken_anew(runs.run(moved_from(first, (CHAIN,), at(1.0))))
    # a step that is not followed by another look, and one more
    third = moved_from(second, (CHAIN,), at(1.5))
    third = runs.taken_anew(runs.run(moved_from(runs.run(third), (CHAIN,), at(2.0))))
    assert fit.asked == [
        ('whole', 0.0, (CHAIN.cause, LINK.cause)),
        ('secant', 0.0, {'mass': 1.0}),
        ('secant', 1.0, {'mass': 2.0}),
    ]
    assert runs.taken_anew(third) is third  # nothing has changed


def test_far_off_they_are_run_again():
    fit, runs = Fit(), Machine()
    near = runs.taken_anew(point_of((LINK,), fit))
    far = runs.run(replace(near, turned=at(2.0), is_whole=False, since=None))
    runs.taken_anew(runs.run(moved_from(far, (CHAIN,), at(2.1))))
    assert [one[:2] for one in fit.asked] == [('whole', 0.0), ('whole', 2.1)]


def test_without_one_a_pitch_of_the_machine_is_enough_every_time(monkeypatch):
    asked = []
    monkeypatch.setattr(points, '_anew', lambda _, point: asked.append(point.turned) or Fit())
    runs = Machine()
    first = runs.taken_anew(point_of((), Fit()))
    runs.taken_anew(runs.run(moved_from(first, (CHAIN,), at(1.0))))
    assert asked == [{}, at(1.0)]
