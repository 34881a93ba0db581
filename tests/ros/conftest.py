"""What the tests of the nodes share: a context, programs in processes of their own, a witness."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from escalator_twin import bagfile
from escalator_twin.cli.main import main
from escalator_twin.machine import load_machine

ROOT = Path(__file__).resolve().parents[2]
TOY = ROOT / 'tests' / 'data' / 'toy.yaml'
SAMPLE = ROOT / 'bags' / 'sample_clean'
PROTOTYPE = ROOT / 'config' / 'machines' / 'prototype.yaml'


@pytest.fixture(scope='session')
def node() -> Iterator[object]:
    """Return a node of the test process."""
    import rclpy

    context = rclpy.Context()
    rclpy.init(context=context)
    made = rclpy.create_node('test', context=context)
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.fixture(scope='session')
def toy_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return 24 s of the toy machine's real instruments, as if they had been measured."""
    folder = tmp_path_factory.mktemp('toy')
    case = 'speed=0.293,direction=down,load=1.5,preload=900'
    words = ['--duration', '24', '--start-s', '0.71', '--instruments', 'real', '--seed', '5']
    made = folder / 'simulated'
    assert (
        main(['simulate', '--machine', str(TOY), '--case', case, *words, '--out', str(made)]) == 0
    )
    machine = load_machine(TOY)
    recording = bagfile.read(made, machine)
    assert recording.experiment is not None
    set_speed = replace(recording.experiment, set_speed_m_s=0.3)
    bagfile.write(
        folder / 'toy', replace(recording, experiment=set_speed), machine, namespace='/bench'
    )
    return folder / 'toy'
