"""The true diagnosis over DDS, with no other comparator about."""

import json

import pytest

from escalator_twin.cli.main import main

from .conftest import PROTOTYPE, ROOT
from .programs import program
from .test_diagnosing import Asker
from .test_replay import same

pytestmark = [pytest.mark.ros, pytest.mark.issue(7)]

GUIDE_STEP = ROOT / 'bags' / 'sample_guide_step'


@pytest.mark.long
@pytest.mark.slow
def test_true_diagnosis_in_the_graph_is_that_of_the_command_line(node, tmp_path):
    asker = Asker(node)
    file = tmp_path / 'offline.json'
    words = ['--machine', str(PROTOTYPE), '--json', str(file), '--seed', '3']
    assert main(['diagnose', str(GUIDE_STEP), *words]) == 0
    with program('comparator', tmp_path, machine=PROTOTYPE) as comparator:
        comparator.wait_for('listening')
        asker.connect()
        told = []
        out = str(tmp_path / 'offline_extended.yaml')
        _, result = asker.ask(
            told, 500.0, bags=[str(GUIDE_STEP)], seed=3, jobs=1, extended_machine=out
        )
        assert result.success, result.message
        assert comparator.interrupt() == 0
    assert told[-1].fraction == 1.0
    same(json.loads(result.json), json.loads(file.read_text()))
