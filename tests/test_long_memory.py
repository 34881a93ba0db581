"""Two hours and four gigabytes take no more memory than ten minutes."""

from dataclasses import replace
import json
import subprocess
import sys

from longbags import BLOCK_S, long_bag
from makers import (
    PROTOTYPE,
    prototype,
)
import pytest

from escalator_twin.instruments import record
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation, run_twin

pytestmark = pytest.mark.issue(5)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'


def round_once():
    """Return a minute in which the twin goes round exactly once, so that it can be repeated."""
    loggers = {
        name: replace(logger, drift_ppm=0.0)
        for name, logger in MACHINE.instruments.loggers.items()
    }
    sensors = tuple(replace(s, thermal_drift=0.0) for s in MACHINE.instruments.sensors)
    instruments = replace(MACHINE.instruments, loggers=loggers, sensors=sensors)
    machine = replace(MACHINE, instruments=instruments)
    chain = machine.chain
    experiment = Experiment(
        chain.n_links * chain.pitch_m / BLOCK_S, 1, (75.0,), 6000.0, machine=machine.name
    )
    simulation = make_simulation(machine, experiment)
    trace = run_twin(simulation, sensors, 3.0, float(BLOCK_S), 200.0)
    return record(trace, machine, experiment, seed=3)


MEASURE = """
import json, re, sys
from pathlib import Path
from escalator_twin.check import check
from escalator_twin.machine import load_machine
from escalator_twin.pipeline import compare_bag
if sys.argv[3] == 'check':
    document = check(sys.argv[1], load_machine(sys.argv[2]))
else:
    document = compare_bag(sys.argv[1], sys.argv[2])
    del document['overlay']
status = Path('/proc/self/status').read_text()
peak = int(re.search(r'VmHWM:\\s+(\\d+) kB', status)[1]) / 1024
print(json.dumps({'peak_mb': peak, 'document': document}, default=float))
"""


def measured(path, verb='check'):
    """Run a verb in a process of its own; return its peak in MB and its document."""
    command = [sys.executable, '-c', MEASURE, str(path), str(PROTOTYPE), verb]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    result = json.loads(done.stdout)
    return result['peak_mb'], result['document']


@pytest.mark.slow
def test_two_hours_take_no_more_memory_than_ten_minutes(tmp_path):
    peaks = {}
    for name, duration_s in (('short', 600), ('long', 7200)):
        path = tmp_path / f'{name}.mcap'
        total = long_bag(path, duration_s)
        assert total == pytest.approx(1100 * duration_s, rel=1e-3)
        peaks[name], document = measured(path)
        path.unlink()
        assert sum(row['n_messages'] for row in document['topics']) == total
        assert document['clock']['offset_s'] is not None
        assert not {row['kind'] for row in document['quality']} & {'data_gap', 'rate', 'jitter'}
    print(peaks)
    assert peaks['long'] < 500.0
    assert peaks['long'] < 1.1 * peaks['short']


@pytest.mark.long
@pytest.mark.slow
def test_two_hours_are_compared_in_no_more_memory_than_ten_minutes(tmp_path):
    minute, peaks = round_once(), {}
    for name, duration_s in (('short', 600), ('long', 7200)):
        path = tmp_path / f'{name}.mcap'
        long_bag(path, duration_s, minute=minute)
        peaks[name], document = measured(path, 'compare')
        path.unlink()
        assert document['speed_m_s']['value'] == pytest.approx(0.405, rel=1e-3)
        assert document['start_s_m'] == pytest.approx(3.0, abs=0.015)
        assert document['channels'][LEFT_A]['r_time'] > 0.999
    assert document['parts']['n'] == 16
    print(peaks)
    assert peaks['long'] < 500.0
    assert peaks['long'] < 1.1 * peaks['short']


@pytest.mark.slow
def test_four_gigabytes_of_another_topic_are_skipped(tmp_path):
    plain, bulky = tmp_path / 'plain.mcap', tmp_path / 'bulky.mcap'
    long_bag(plain, 600)
    long_bag(bulky, 600, hole_bytes=72_000_000)
    assert bulky.stat().st_size > 4 * 2**30
    peak, document = measured(plain)
    bulk_peak, with_bulk = measured(bulky)
    print(peak, bulk_peak)
    assert with_bulk['quality'] == document['quality']
    assert with_bulk['container']['losses'] == []
    assert bulk_peak < 1.1 * peak
    assert bulk_peak < 500.0
