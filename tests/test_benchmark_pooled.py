"""The pooled rates of docs/figures.md are those of its own table."""

from collections import Counter
import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.one_speed import BAR, named, NAMED_ON_CLEAN, RISE, SPEED_M_S, SPEEDS_M_S, TOLERANCE
from benchmarks.one_speed import lines_of as lines_of_speed
from benchmarks.pooled import (
    calibration_line,
    counts,
    lines_of,
    lines_of_causes,
    of_causes,
    pooled,
    REFERENCE,
    rows_of,
    SINCE,
)

pytestmark = pytest.mark.issue(6)

DOCS = Path(__file__).resolve().parents[1] / 'docs'
PAGE, CAUSES = DOCS / 'figures.md', DOCS / 'figures_causes.csv'
BELIEFS = DOCS / 'figures_beliefs.csv'


def test_the_page_tells_what_its_table_says():
    text = PAGE.read_text(encoding='utf-8')
    rows = list(rows_of(text))
    seeds = [row[0].split(',')[0] for row in rows]
    expected = lines_of(rows[: seeds.index(SINCE) + 1])
    assert len(expected) == 7
    assert [line for line in expected if line not in text.splitlines()] == []


def test_causes_add_up_to_the_sets():
    rows = list(rows_of(PAGE.read_text(encoding='utf-8')))
    rows = rows[: [row[0].split(',')[0] for row in rows].index(SINCE) + 1]
    sets = {row[0].split(',')[0]: counts(row[REFERENCE]) for row in rows}
    asked, right = Counter(), Counter()
    with CAUSES.open(encoding='utf-8', newline='') as file:
        for row in csv.DictReader(file):
            asked[row['seed']] += int(row['recordings'])
            right[row['seed']] += int(row['right'])
    told = {seed: found[0] for seed, found in sets.items() if found}
    assert {seed: (right[seed], asked[seed]) for seed in asked} == told
    rates = of_causes(CAUSES, sets).values()
    assert sum(r.trials for r in rates) == pooled(rows, REFERENCE).trials


def test_the_page_tells_how_calibrated_the_kept_statements_are(tmp_path):
    text = PAGE.read_text(encoding='utf-8')
    assert calibration_line(BELIEFS) in text.splitlines()
    sure = tmp_path / 'sure.csv'
    sure.write_text('seed,probability,right\n' + '1,0.9,1\n' * 18 + '1,0.9,0\n' * 2)
    assert '| 0.000 of 20 statements' in calibration_line(sure)


def test_the_page_tells_every_cause_that_was_missed():
    text = PAGE.read_text(encoding='utf-8')
    seeds = [row[0].split(',')[0] for row in rows_of(text)]
    expected = lines_of_causes(of_causes(CAUSES, seeds[: seeds.index(SINCE) + 1]))
    assert [line for line in expected if line not in text.splitlines()] == []


@pytest.mark.parametrize(
    ('cell', 'found'),
    [
        ('10 of 11 (91 %, 59 to 100), both', [(10, 11), (10, 11)]),
        ('5 of 6 (83 %), both; one ended by an error', [(5, 6), (5, 6)]),
        ('2 of 3 (9 to 99), 3 of 3 (29 to 100)', [(2, 3), (3, 3)]),
        ('4 of 6 (22 to 96), **one named**', [(4, 6)]),
        ('-', []),
    ],
)
def test_counts_of_a_cell(cell, found):
    assert counts(cell) == found


def test_what_one_speed_can_tell_is_what_draws_show():
    rng = np.random.default_rng(1)
    own = rng.normal(1.0, TOLERANCE, 400_000)
    grown = own * (1.0 + RISE * np.exp(-0.25 / SPEED_M_S))
    assert named(0.25, 3.0) == pytest.approx(np.mean(grown > 1.3), abs=3e-3)


def test_no_threshold_reaches_the_bar_at_one_speed():
    most = float(norm.isf(NAMED_ON_CLEAN))
    assert np.mean([named(v, most) for v in SPEEDS_M_S]) < BAR
    text = PAGE.read_text(encoding='utf-8').splitlines()
    assert [line for line in lines_of_speed() if line not in text] == []
