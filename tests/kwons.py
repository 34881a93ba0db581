"""The second machine for tests, built once."""

from functools import cache
from pathlib import Path

from escalator_twin.machine import load_machine, MultibodyMachine
from escalator_twin.physics.multibody.layout import lay_out
from escalator_twin.physics.multibody.simulation import MultibodySimulation

MACHINES = Path(__file__).resolve().parents[1] / 'config' / 'machines'


@cache
def kwon(name: str = 'kwon') -> MultibodyMachine:
    machine = load_machine(MACHINES / f'{name}.yaml')
    assert isinstance(machine, MultibodyMachine)
    return machine


def simulation(parts=('steps', 'handrail'), name='kwon', machine=None) -> MultibodySimulation:
    machine = machine or kwon(name)
    return MultibodySimulation(machine, lay_out(machine, machine.default_experiment(), parts))
