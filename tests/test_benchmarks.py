"""The bars on speed and memory, by processor time: other programs then disturb them least.

Not in ``make test``: a machine that does other things shares caches and clocks as well.

Wall time is what ``make bench`` prints. Two workers are as quick as half of their processor time
where nothing else runs.
"""

import importlib.util

import pytest

from benchmarks import comparison, peer, simulation
from benchmarks.measure import alone
from escalator_twin.machine import load_machine

pytestmark = pytest.mark.slow
CORES = 2


@pytest.mark.long
@pytest.mark.issue(3)
@pytest.mark.parametrize(('planar', 'bar'), [(False, 40.0), (True, 100.0)])
def test_simulation_is_faster_than_real_time(planar, bar):
    result = alone(simulation.real_time_factor, planar)
    assert result['bars']['value'] == bar
    assert result['by_processor_time'] >= bar


@pytest.mark.long
@pytest.mark.issue(3)
@pytest.mark.parametrize('planar', [False, True])
def test_the_cost_of_a_link_does_not_grow_with_their_number(planar):
    result = alone(simulation.cost_of_links, planar)
    assert [row['links'] for row in result['rows']] == [60, 120, 240, 480]
    assert result['rows'][-1]['rise_m'] == pytest.approx(47.0, abs=0.05)
    assert result['value'] <= 1.2
    assert result['rows'][-1]['by_processor_time'] > 1.0


@pytest.mark.long
@pytest.mark.issue(3)
def test_the_experiment_plan_takes_less_than_a_minute():
    result = alone(simulation.plan)
    assert result['experiments'] == 16
    assert result['processor_seconds'] / CORES < 60.0


@pytest.mark.long
@pytest.mark.issue(3)
@pytest.mark.skipif(
    importlib.util.find_spec('exudyn') is None, reason='exudyn is not there: make bench-deps'
)
def test_the_planar_model_outruns_another_program():
    result = alone(peer.against_peer)
    assert result['same_model']['rms_n'] < 0.1
    solvers = {one['solver'] for one in result['each_solver_at_its_largest_step']}
    assert solvers == {*peer.EXPLICIT_STEPS_S, *peer.IMPLICIT}
    assert result['value'] >= 5.0


def test_a_longer_machine_closes_like_the_short_one():
    machine = load_machine(simulation.MACHINE)
    long = simulation.longer(machine, 120)
    for one in (machine, long):
        run = simulation.started(one, planar=True, settle_s=0.5)
        assert abs(run.data.qpos[0]) < 0.05
        spare = run.path.length_m - one.chain.n_links * one.chain.pitch_m
        assert spare == pytest.approx(0.1057, abs=0.002)


@pytest.mark.long
@pytest.mark.issue(5)
def test_all_metrics_of_twenty_long_channels_are_quick_and_small():
    result = alone(comparison.metrics)
    assert (result['channels'], result['samples']) == (20, 1_000_000)
    assert result['processor_seconds'] / CORES < 3.0
    assert result['peak_rss_mb'] < 500.0
