"""The pooled rates of docs/figures.md are those of its own table."""

from pathlib import Path

import pytest

from benchmarks.pooled import counts, lines_of, rows_of, SINCE

pytestmark = pytest.mark.issue(6)

PAGE = Path(__file__).resolve().parents[1] / 'docs/figures.md'


def test_the_page_tells_what_its_table_says():
    text = PAGE.read_text(encoding='utf-8')
    rows = list(rows_of(text))
    seeds = [row[0].split(',')[0] for row in rows]
    expected = lines_of(rows[: seeds.index(SINCE) + 1])
    assert len(expected) == 7
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
