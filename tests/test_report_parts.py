"""What the page is computed from: packed series, outlines, ticks, factors and their effects."""

import statistics

from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from report_samples import campaign

from escalator_twin.report.documents import read_page
from escalator_twin.report.drawing import outline, ticks
from escalator_twin.report.factors import find_factors, lenth_margin, main_effects
from escalator_twin.report.numerals import correlation, fixed, place, plain, significant
from escalator_twin.report.series import array, GAP, LEVELS, pack, spectrum, unpack

pytestmark = pytest.mark.issue(5)

# a span of subnormal numbers has no half level: half of the least of them is 0
values_strategy = st.lists(
    st.floats(-1e9, 1e9, allow_subnormal=False) | st.just(float('nan')), min_size=1, max_size=60
).map(np.array)


@settings(max_examples=200, deadline=None)
@given(values_strategy, st.booleans())
def test_packed_series_come_back_within_half_a_level(values, straighten):
    back = unpack(pack(values, straighten))
    known = np.isfinite(values)
    assert np.array_equal(np.isfinite(back), known)
    if known.any():
        # taking a line off at most doubles the span
        span = 2.0 * (values[known].max() - values[known].min())
        allowed = 0.51 * span / (2 * LEVELS) + 1e-11 * np.abs(values[known]).max()
        assert np.abs(back - values)[known].max() <= allowed


def test_even_steps_are_packed_without_samples():
    packed = pack(np.arange(500) * 0.05, straighten=True)
    assert 'q' not in packed
    assert unpack(packed) == pytest.approx(np.arange(500) * 0.05)
    assert GAP < -LEVELS


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-500, 500), min_size=2, max_size=300))
def test_outline_keeps_every_extreme(values):
    down = np.array(values)
    column = np.arange(len(down)) // 7
    reached = _ordinates(outline(column, down, 0.0, 2.0))
    assert min(reached) == np.round(down.min())
    assert max(reached) == np.round(down.max())


def test_outline_breaks_at_a_gap():
    column = np.arange(200)
    down = np.where((column > 80) & (column < 120), np.nan, 1.0)
    assert outline(column, down, 0.0, 2.0).count('M') == 2


def _ordinates(path):
    """Follow a path and return the ordinates that it goes through."""
    found, here = [], 0
    for step in path.replace('M', ' M').replace('l', ' l').replace('v', ' v').split(' '):
        if step.startswith('v'):
            here += int(step[1:])
        elif step and step[0] in 'Ml':
            mark = step[0]
            continue
        elif step:
            here = int(step) if mark == 'M' else here + int(step)
        if step:
            found.append(here)
    return found


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 10))
@example(879609.9999999999, 1e-6, 6)
def test_ticks_are_at_least_two_inside_the_range(low, span, count):
    marks = ticks(low, low + span, count)
    assert 2 <= len(marks) <= 4 * count
    # numbers so large are rounded by more than a millionth of so little
    off = 1e-6 * span + 4.0 * float(np.spacing(abs(low) + span))
    assert all(low - off <= mark <= low + span + off for mark in marks)


def test_spectrum_of_a_wave_has_its_amplitude():
    time = np.arange(2000) / 20.0
    frequency, amplitude = spectrum(time, 3.0 * np.sin(2 * np.pi * 1.25 * time), 8.0)
    assert frequency[np.argmax(amplitude)] == pytest.approx(1.25)
    assert amplitude.max() == pytest.approx(3.0, rel=1e-3)
    assert frequency.max() <= 8.0


def test_array_takes_numbers_and_leaves_gaps():
    assert np.array_equal(array([1.0, None, 2]), [1.0, np.nan, 2.0], equal_nan=True)
    assert np.array_equal(array([1.0, 'x', 2]), [1.0, np.nan, 2.0], equal_nan=True)
    assert len(array('text')) == 0
    assert len(array([[1.0], [2.0]])) == 2


def test_factors_come_from_settings_and_from_names_of_cases():
    page = read_page([campaign()])
    factors = find_factors(page.recordings)
    assert [f.name for f in factors] == ['speed (m/s)', 'direction', 'empty / full', 'lo / hi']
    assert factors[0].levels == ('0.25', '0.5')
    assert factors[1].levels == ('down', 'up')
    told = [
        {**e.data, 'experiment': {'load_per_step_kg': [75.0 * (i % 2)]}}
        for i, e in enumerate(page.recordings)
    ]
    named = find_factors(read_page([{**campaign(), 'recordings': told}]).recordings)
    assert 'load (kg)' in [f.name for f in named]


def test_main_effects_of_an_additive_plan_are_exact():
    factors = find_factors(read_page([campaign()]).recordings)
    values = [2.0 + 0.3 * factors[0].signs[i] - 0.7 * factors[2].signs[i] for i in range(16)]
    effects = main_effects(factors, values)
    assert [e.size for e in effects] == pytest.approx([0.6, 0.0, -1.4, 0.0], abs=1e-12)
    assert [e.is_clear for e in effects] == [True, False, True, False]


def test_margin_of_error_is_lenths():
    signs = np.array([[2 * ((i >> bit) & 1) - 1 for i in range(8)] for bit in range(3)])
    y = np.array([3.1, 4.7, 2.9, 9.2, 3.3, 5.0, 2.7, 8.8])
    a, b, c = signs
    rows = (a, b, c, a * b, a * c, b * c, a * b * c)
    contrasts = [abs(y[row > 0].mean() - y[row < 0].mean()) for row in rows]
    first = 1.5 * statistics.median(contrasts)
    pseudo = 1.5 * statistics.median([v for v in contrasts if v <= 2.5 * first])
    # t(0.975) of 7/3 degrees of freedom, table of Lenth (1989)
    assert lenth_margin(signs, y) == pytest.approx(3.764 * pseudo, rel=1e-3)


def test_no_margin_without_a_full_plan():
    signs = np.array([[2 * ((i >> bit) & 1) - 1 for i in range(8)] for bit in range(3)])
    assert lenth_margin(signs[:, :7], np.arange(7.0)) is None
    assert lenth_margin(signs[:, [0, 0, 2, 3, 4, 5, 6, 7]], np.arange(8.0)) is None


@pytest.mark.parametrize(
    ('shown', 'text'),
    [
        (correlation(0.99996), '> 0.9999'),
        (correlation(1.0), '1.0000'),
        (correlation(None), '–'),
        (fixed(-0.00001, 3, 'm', sign=True), '0.000\u202fm'),
        (significant(1234567.0), '1234567'),
        (significant(0.00012345), '0.0001234'),
        (significant(2.5e-9), '2.5·10⁻⁹'),
        (plain({'value': 1.31, 'low': 1.2, 'high': 1.42}), '1.31 (1.2 to 1.42)'),
        (
            place({'s_from_m': 3.1, 's_to_m': 4.4, 'side': 'both'}),
            's = 3.1 to 4.4\u202fm, both sides',
        ),
        (place({}), '–'),
    ],
)
def test_numbers_read_well(shown, text):
    assert shown == text
