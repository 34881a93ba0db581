"""The machine description: one frozen class a kind of machine, read from YAML."""

from escalator_twin.machine.linked import (
    Chain,
    DefaultExperiment,
    Deviation,
    DIRECTIONS,
    Drive,
    ExperimentTopic,
    Guide,
    Instruments,
    Lateral,
    Load,
    Logger,
    Machine,
    Recorder,
    Roller,
    Sensor,
    Tensioner,
)
from escalator_twin.machine.loading import load_machine, machines_folder, PHYSICS, SAFE, SCHEMA
from escalator_twin.machine.multibody import MultibodyMachine

__all__ = [
    'DIRECTIONS',
    'PHYSICS',
    'SAFE',
    'SCHEMA',
    'Chain',
    'DefaultExperiment',
    'Deviation',
    'Drive',
    'ExperimentTopic',
    'Guide',
    'Instruments',
    'Lateral',
    'Load',
    'Logger',
    'Machine',
    'MultibodyMachine',
    'Recorder',
    'Roller',
    'Sensor',
    'Tensioner',
    'load_machine',
    'machines_folder',
]
