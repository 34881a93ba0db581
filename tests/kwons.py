"""The second machine for tests, built once."""

from functools import cache
from pathlib import Path

import yaml

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


SMALL = {'n_links': 24, 'rise_m': 1.0, 'lower_landing_m': 0.7156}  # the chain closes


def write_small(folder: Path) -> Path:
    """Write the second machine with a metre of rise and no handrail; cheap to run."""
    sheet = yaml.safe_load((MACHINES / 'kwon.yaml').read_text(encoding='utf-8'))
    sheet['chain']['n_links'] = SMALL['n_links']
    for key in ('rise_m', 'lower_landing_m'):
        sheet['guide'][key] = SMALL[key]
    del sheet['handrail']
    for kind in ('sensors', 'simulated_only'):
        rows = sheet['instruments'][kind]
        sheet['instruments'][kind] = [r for r in rows if not r['quantity'].startswith('handrail')]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / 'kwon.yaml'
    path.write_text(yaml.safe_dump(sheet, sort_keys=False), encoding='utf-8')
    return path
