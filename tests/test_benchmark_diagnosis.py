"""How a benchmark set is drawn and asked for: nothing about a bag tells what is in it."""

from collections import Counter
import itertools
import json

import pytest

from benchmarks import diagnosis
from benchmarks.diagnosis import diagnose_all, draw_set, LISTED, NOT_LISTED, recordings, score

pytestmark = pytest.mark.issue(6)

BOTH = ('reference', 'third')


def counted(plans):
    return Counter((p.cause or 'clean', p.size) for p in plans)


def test_a_set_holds_what_is_asked_for():
    kinds = len(NOT_LISTED)
    counts = counted(
        draw_set(5, 2, 7, kinds + 1, ['roller_drag', 'gauge_dead', 'step_mass'], BOTH)
    )
    assert counts['clean', None] == 7
    assert counts['roller_drag', 'reference'] == counts['roller_drag', 'third'] == 2
    assert counts['step_mass', 'third'] == 2
    assert counts['gauge_dead', None] == 2  # it has no size, so it is there once
    unlisted = {name: n for (name, _), n in counts.items() if name.startswith('unlisted_')}
    assert sum(unlisted.values()) == kinds + 1
    assert len(unlisted) == kinds  # each of them before any a second time


def test_a_few_that_are_on_no_list_are_not_the_same_few_in_every_set():
    drawn = {p.cause for seed in range(20) for p in draw_set(seed, 0, 0, 3, [], BOTH)}
    assert len(drawn) > len(NOT_LISTED) // 2


def test_every_cause_of_the_list_can_be_drawn():
    plans = draw_set(6, 1, 0, 0, list(LISTED), BOTH)
    assert {p.cause for p in plans} == set(LISTED)


def test_names_and_order_tell_nothing():
    plans = draw_set(5, 3, 10, 10, ['roller_drag', 'step_mass'], BOTH)
    assert [p.name for p in plans] == [f'machine_{k:03d}' for k in range(len(plans))]
    causes = [p.cause for p in plans]
    assert causes != sorted(causes, key=str)
    runs = sum(a != b for a, b in itertools.pairwise(causes))
    assert runs > len(plans) // 2


def test_a_seed_gives_its_set_again_and_another_one_another():
    one, again, other = (draw_set(s, 2, 3, 3, ['roller_drag'], BOTH) for s in (5, 5, 6))
    assert one == again
    assert one != other
    seeds = {order.seed for plan in one for order in plan.orders}
    assert len(seeds) == len(one)
    assert not seeds & {order.seed for plan in other for order in plan.orders}


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Return a set of three bags whose verdicts are given, the second without one."""
    rows = [{'name': f'machine_{k:03d}', 'recordings': [f'machine_{k:03d}_0']} for k in range(3)]
    (tmp_path / 'manifest.json').write_text(json.dumps({'machines': rows}))
    (tmp_path / 'truth').mkdir()
    for k in range(3):
        truth = {'effects': [], 'size': None, 'speed_m_s': 0.5}
        (tmp_path / 'truth' / f'machine_{k:03d}_0.json').write_text(json.dumps(truth))
    asked = []

    def answer(bags, folder, machine, jobs):
        (bag,) = bags
        asked.append((bag.name, jobs))
        verdict = {'effects': [], 'candidates': [], 'unexplained': {'significant': False}}
        (folder / f'{bag.name}.json').write_text(json.dumps(verdict))
        failed = {'status': 2} if bag.name == 'machine_001_0' and machine else {}
        return {'name': bag.name, 'seconds': 1.0, **failed}

    monkeypatch.setattr(diagnosis, 'diagnose', answer)
    return tmp_path, asked


def ask(out, machine=True, at_once=1, keep=False):
    return list(diagnose_all(recordings(out), out / 'verdicts', machine, at_once, 2, keep))


def test_a_run_that_fails_is_no_verdict(made):
    out, asked = made
    outcomes = score(out, ask(out))
    assert [o.failed for o in outcomes] == [False, True, False]
    assert [jobs for _, jobs in asked] == [2, 2, 2]


def test_recordings_at_once_share_the_cores(made):
    out, asked = made
    ask(out, at_once=2)
    assert [jobs for _, jobs in asked] == [1, 1, 1]


def test_only_what_has_a_verdict_is_kept(made):
    out, asked = made
    ask(out)
    asked.clear()
    outcomes = score(out, ask(out, machine=False, keep=True))
    assert asked == [('machine_001_0', 2)]
    assert not any(o.failed for o in outcomes)
    asked.clear()
    ask(out)
    assert len(asked) == 3
