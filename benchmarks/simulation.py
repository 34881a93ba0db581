"""Real-time factor of the twin on one core, both models."""

import json
from pathlib import Path
import statistics
import time

from benchmarks.reference import reference_s
from escalator_twin.machine import load_machine
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation

MACHINE = Path(__file__).resolve().parents[1] / 'config' / 'machines' / 'prototype.yaml'
SIMULATED_S, REPEATS, RATE_HZ = 20.0, 3, 200.0
# loaded, 6 kN, with clearance and survey: the most work that the experiment plan asks for
CASE = Experiment(0.5, 1, (75.0,), 6000.0)


def real_time_factor(planar: bool) -> dict[str, object]:
    """Return simulated over wall seconds: median of three, all sensors recorded at 200 Hz."""
    machine = load_machine(MACHINE)
    simulation = make_simulation(machine, CASE, planar)
    simulation.start(3.0)
    simulation.trace(1.0, RATE_HZ, machine.instruments.sensors)
    walls, references = [], []
    for _ in range(REPEATS):
        references.append(reference_s())
        start = time.perf_counter()
        simulation.trace(SIMULATED_S, RATE_HZ, machine.instruments.sensors)
        walls.append(time.perf_counter() - start)
    wall = statistics.median(walls)
    return {
        'name': 'real_time_factor_planar' if planar else 'real_time_factor_two_sided',
        'value': round(SIMULATED_S / wall, 1),
        'bar': 100.0 if planar else 40.0,
        'reference_loops': round(wall / statistics.median(references), 2),
        'settings': {
            'step_s': simulation.step_s,
            'links': machine.chain.n_links,
            'simulated_s': SIMULATED_S,
            'recorded_hz': RATE_HZ,
            'case': '0.5 m/s up, 75 kg on every step, 6000 N',
        },
    }


def main() -> None:
    """Print one JSON line a model."""
    for planar in (False, True):
        print(json.dumps(real_time_factor(planar)), flush=True)


if __name__ == '__main__':
    main()
