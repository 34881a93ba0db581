"""The simulation against truth from outside: every figure with a bar meets it."""

from importlib import import_module
from xml.etree import ElementTree

import numpy as np
import pytest

from escalator_twin.machine import load_machine
from escalator_twin.verification import recordings
from escalator_twin.verification.__main__ import MACHINES, PARTS
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.plot import Line, svg

pytestmark = [pytest.mark.issue(3), pytest.mark.slow]


@pytest.mark.parametrize('part', PARTS)
def test_every_figure_meets_its_bar(root, part):
    file = root / 'config' / 'machines' / MACHINES.get(part, 'prototype.yaml')
    found = import_module(f'escalator_twin.verification.{part}').figures(load_machine(file))
    barred = [f for f in found if (f.most, f.least) != (None, None)]
    assert barred
    missed = [figure.line() for figure in barred if not figure.holds]
    assert not missed


def test_a_figure_beyond_its_bar_is_told():
    assert not Figure('a', 'b', 2.0, most=1.0).holds
    assert not Figure('a', 'b', 0.0, least=1.0).holds
    assert Figure('a', 'b', 1.0, most=1.0, least=0.5).holds
    assert Figure('a', 'b', 2.0, most=1.0).line().startswith('!')


@pytest.mark.shared
def test_the_other_program_agrees_below_two_hertz(root, shared):
    paths = [shared / 'measured' / 'seeded' / name for name in ('clean_1', 'clean_2')]
    machine = load_machine(root / 'config' / 'machines' / 'prototype.yaml')
    found = recordings.figures(machine, paths)
    barred = [figure for figure in found if figure.least is not None]
    assert len(barred) >= 4 * len(paths)
    missed = [figure.line() for figure in barred if not figure.holds]
    assert not missed


def test_plots_are_svg_with_a_line_for_each_curve():
    x = np.linspace(0.0, 1.0, 2000)
    text = svg('title', 'x, m', 'y, m', [Line('one', x, x), Line('two <', x, -x)])
    drawing = ElementTree.fromstring(text)
    assert len(drawing.findall('{http://www.w3.org/2000/svg}polyline')) == 2
    assert len(text) < 30_000
