"""From a bag to a named cause by the command itself; the truth is read after the verdict."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any, NamedTuple

import pytest
from rig.machine import Case
from rig.make import Effect, make, Order, write
import yaml

from benchmarks.scoring import judge, Truth

pytestmark = [pytest.mark.issue(6), pytest.mark.slow]

CASE = Case(0.5, 1, 75.0, 3000.0)
DURATION_S = 75.0  # a loop and a half at 0.5 m/s: there is a second look
HIDDEN = {
    'drag': Order(60_606, CASE, DURATION_S, (Effect('roller_drag', {'axle': 23, 'side': 'right'},
                                                    {'force_N': 120.0}),)),
    'clean': Order(60_607, CASE, DURATION_S),
    'frame': Order(60_608, CASE, DURATION_S, (Effect('truss_resonance', {}, {
        'frequency_hz': 6.3, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}),)),
}  # fmt: skip
ALL_SHARED = (
    'clean_1', 'clean_2', 'drive_ripple', 'gauge_gain', 'load_distribution', 'roller_drag',
    'roller_eccentricity', 'rolling_resistance', 'tensioner_friction',
)  # fmt: skip
LIMIT_S = 570.0

Start = Callable[[Path], 'Future[Told]']


class Told(NamedTuple):
    """What the command left."""

    status: int
    errors: str
    verdict: dict[str, Any]


@pytest.fixture(scope='session')
def start(tmp_path_factory) -> Iterator[Start]:
    """Return what diagnoses a bag in a process of its own; each bag once, two at a time."""
    folder = tmp_path_factory.mktemp('verdicts')
    known: dict[Path, Future[Told]] = {}

    def work(bag: Path) -> Told:
        target = folder / f'{bag.parent.name}_{bag.name}.json'
        words = [sys.executable, '-m', 'escalator_twin.cli.main', 'diagnose', str(bag)]
        done = subprocess.run(
            [*words, '--json', str(target)], capture_output=True, text=True, timeout=LIMIT_S,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}, check=False,
            cwd=Path(__file__).resolve().parents[1],
        )  # fmt: skip
        verdict = json.loads(target.read_text(encoding='utf-8')) if target.exists() else {}
        return Told(done.returncode, done.stderr, verdict)

    with ThreadPoolExecutor(2) as pool:

        def once(bag: Path) -> 'Future[Told]':
            if bag not in known:
                known[bag] = pool.submit(work, bag)
            return known[bag]

        yield once
        pool.shutdown(cancel_futures=True)


@pytest.fixture(scope='session')
def hidden(start, tmp_path_factory, request) -> dict[str, tuple[Future[Told], Path]]:
    """Return verdicts to come, and where the truth lies, of what this session asks for."""
    folder = tmp_path_factory.mktemp('hidden')
    asked = {
        mark.args[0]
        for item in request.session.items
        if not item.get_closest_marker('skip')
        for mark in item.iter_markers('asks_for')
    }
    found = {}
    for number, (name, order) in enumerate(HIDDEN.items()):
        if name in asked:
            bag, truth = folder / f'machine_{number}', folder / 'truth' / f'{number}.json'
            write(make(order), bag, truth)
            found[name] = start(bag), truth
    return found


def told(future: Future[Told]) -> dict[str, Any]:
    status, errors, verdict = future.result()
    assert status == 0, errors
    return verdict


def outcome(hidden, name):
    future, path = hidden[name]
    verdict = told(future)
    truth = Truth.of(json.loads(path.read_text(encoding='utf-8')))
    return judge(truth, verdict), verdict


@pytest.mark.asks_for('drag')
def test_a_hidden_drag_is_named_at_its_axle(hidden):
    found, verdict = outcome(hidden, 'drag')
    assert found.cause_right
    assert found.place_right
    assert found.size_errors[0] < 0.15
    assert [e['cause'] for e in verdict['effects']] == ['roller_drag']


@pytest.mark.long
@pytest.mark.asks_for('drag')
def test_its_extension_runs_and_gains(hidden):
    _, verdict = outcome(hidden, 'drag')
    description = yaml.safe_load(Path(verdict['extended_machine']).read_text(encoding='utf-8'))
    assert [d['cause'] for d in description['deviations']] == ['roller_drag']
    held = verdict['gain']['held_out']
    assert held['significant']
    assert held['worse'] == []
    assert (
        min(row['chi2_after'] / row['chi2_before'] for row in held['channels'].values()) < 0.25
    )  # halved in amplitude


@pytest.mark.long
@pytest.mark.asks_for('frame')
def test_a_hidden_bounce_of_the_frame_is_named(hidden):
    found, verdict = outcome(hidden, 'frame')
    assert [e['cause'] for e in verdict['effects']] == ['truss_resonance']
    assert found.cause_right
    frequency = verdict['effects'][0]['parameters']['frequency_hz']
    assert frequency['value'] == pytest.approx(6.3, rel=0.05)
    assert frequency['low'] < 6.3 < frequency['high']


@pytest.mark.long
@pytest.mark.asks_for('clean')
def test_within_tolerance_nothing_is_named(hidden):
    found, verdict = outcome(hidden, 'clean')
    assert verdict['effects'] == []
    assert not found.flagged
    description = yaml.safe_load(Path(verdict['extended_machine']).read_text(encoding='utf-8'))
    assert description['deviations'] == []


@pytest.fixture(scope='session')
def seeded(start, shared, request) -> dict[str, Future[Told]]:
    """Return verdicts to come on the labelled recordings that this session tests."""
    own = [
        item
        for item in request.session.items
        if 'labelled' in getattr(item, 'fixturenames', ()) and not item.get_closest_marker('skip')
    ]
    names = [item.callspec.params['labelled'] for item in own]
    return {name: start(shared / 'measured' / 'seeded' / name) for name in names}


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.parametrize(
    'labelled',
    ALL_SHARED,
)
def test_labelled_recordings(labelled, seeded, shared):
    verdict = told(seeded[labelled])
    labels = yaml.safe_load((shared / 'measured/seeded/labels.yaml').read_text(encoding='utf-8'))
    truth = Truth.of({'effects': labels[labelled]})
    if truth.kind == 'clean':
        assert verdict['effects'] == []
    else:
        found = judge(truth, verdict)
        assert found.cause_right
        assert found.place_right
