"""What the twin costs: real-time factor, links, memory, the experiment plan."""

from collections.abc import Iterator
from dataclasses import replace
import json
from math import radians, sin

from benchmarks.measure import alone, least, load, MACHINE, resident_mb, Result, spent
from escalator_twin.batch import full_factorial, Run, run_batch, usable_cores
from escalator_twin.machine import load_machine, Machine
from escalator_twin.physics.rollout import Simulation
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation

SIMULATED_S, ROUNDS, RATE_HZ, START_S_M = 20.0, 3, 200.0, 3.0
# loaded, 6 kN, with clearance and survey: the most work that the experiment plan asks for
CASE = Experiment(0.5, 1, (75.0,), 6000.0)
CASE_NAME = '0.5 m/s up, 75 kg on every step, 6000 N'
LINKS = (60, 120, 240, 480)
LONG_S = 2.0
PLAN_LOOPS = 2


def longer(machine: Machine, n_links: int) -> Machine:
    """Return a machine of more links: its incline is longer, and all that lies above moves up."""
    more = 0.5 * (n_links - machine.chain.n_links) * machine.chain.pitch_m  # on each run
    guide, drive = machine.guide, machine.drive
    rise = guide.rise_m + more * sin(radians(guide.inclination_deg))
    return replace(
        machine,
        chain=replace(machine.chain, n_links=n_links),
        guide=replace(guide, rise_m=rise, survey_file=None),
        drive=replace(drive, start_m=drive.start_m + more),
        load=replace(machine.load, to_m=machine.load.to_m + more),
    )


def started(machine: Machine, planar: bool, settle_s: float = 3.0) -> Simulation:
    """Return a simulation at speed."""
    simulation = make_simulation(machine, CASE, planar)
    simulation.start(START_S_M, settle_s)
    return simulation


def real_time_factor(planar: bool) -> Result:
    """Return simulated over spent seconds, all sensors recorded at 200 Hz, on one core."""
    machine = load_machine(MACHINE)
    simulation = started(machine, planar)
    sensors = machine.instruments.sensors
    (cost,) = least([lambda: simulation.trace(SIMULATED_S, RATE_HZ, sensors)], ROUNDS)
    return {
        'benchmark': f'real_time_factor_{_name(planar)}',
        'value': SIMULATED_S / cost.wall_s,
        'by_processor_time': SIMULATED_S / cost.processor_s,
        'bars': {'value': 100.0 if planar else 40.0},
        'settings': {
            'step_s': simulation.step_s,
            'links': machine.chain.n_links,
            'simulated_s': SIMULATED_S,
            'recorded_hz': RATE_HZ,
            'case': CASE_NAME,
        },
        'load': load(),
    }


def memory(planar: bool, n_links: int) -> Result:
    """Return the memory of a process that simulates, and what the simulation adds to it."""
    machine = longer(load_machine(MACHINE), n_links)
    started(load_machine(MACHINE), planar).trace(1.0, RATE_HZ, machine.instruments.sensors)
    before = resident_mb()
    started(machine, planar, 0.5).trace(1.0, RATE_HZ, machine.instruments.sensors)
    return {'links': n_links, 'peak_rss_mb': resident_mb(), 'added_mb': resident_mb() - before}


def cost_of_links(planar: bool) -> Result:
    """Return the cost against the number of links, all in turns."""
    machine = load_machine(MACHINE)
    machines = [longer(machine, n) for n in LINKS]
    simulations = [started(one, planar, 0.5) for one in machines]
    sensors = machine.instruments.sensors
    costs = least([lambda s=s: s.trace(LONG_S, RATE_HZ, sensors) for s in simulations], 5)
    per_link = [cost.processor_s / n for cost, n in zip(costs, LINKS, strict=True)]
    return {
        'benchmark': f'cost_of_links_{_name(planar)}',
        'value': per_link[-1] / per_link[0],
        'rows': [
            {
                'links': n,
                'rise_m': round(one.guide.rise_m, 3),
                'us_per_step': 1e6 * cost.processor_s * simulation.step_s / LONG_S,
                'times_real_time': LONG_S / cost.wall_s,
                'by_processor_time': LONG_S / cost.processor_s,
            }
            for n, one, cost, simulation in zip(LINKS, machines, costs, simulations, strict=True)
        ],
        'bars': {'value': 1.2, 'times_real_time': 1.0},
        'settings': {'step_s': simulations[0].step_s, 'case': CASE_NAME, 'survey': None},
        'load': load(),
    }


def plan() -> Result:
    """Return what the experiment plan costs: 16 cases, two loops each, two-sided, all cores."""
    machine = load_machine(MACHINE)
    loop_m = machine.chain.n_links * machine.chain.pitch_m
    runs = [
        Run(
            machine,
            experiment,
            machine.instruments.sensors,
            START_S_M,
            PLAN_LOOPS * loop_m / experiment.set_speed_m_s,
        )
        for experiment in full_factorial(machine)
    ]
    cost = spent(lambda: run_batch(runs))
    return {
        'benchmark': 'experiment_plan',
        'seconds': cost.wall_s,
        'processor_seconds': cost.processor_s,
        'experiments': len(runs),
        'simulated_s': sum(run.duration_s for run in runs),
        'cores': usable_cores(),
        'peak_rss_mb': resident_mb(),
        'bars': {'seconds': 60.0},
        'load': load(),
    }


def results() -> Iterator[Result]:
    """Yield the result of each benchmark."""
    for planar in (False, True):
        yield alone(real_time_factor, planar)
    for planar in (False, True):
        result = alone(cost_of_links, planar)
        memories = [alone(memory, planar, n) for n in LINKS]
        yield {**result, 'memory': memories}
    yield alone(plan)


def _name(planar: bool) -> str:
    return 'planar' if planar else 'two_sided'


def main() -> None:
    """Print the results, one line each."""
    for result in results():
        print(json.dumps(result), flush=True)


if __name__ == '__main__':
    main()
