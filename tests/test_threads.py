"""The linear algebra takes no threads of its own beside those that were asked for."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from escalator_twin.diagnosis import confirm, diagnose
from escalator_twin.threads import one_thread_each

pytestmark = pytest.mark.issue(7)


class SeenError(Exception):
    """Raised where a diagnosis begins, with the threads that it finds."""


def threads(*_, **__):
    np.ones((2, 2)) @ np.ones((2, 2))
    raise SeenError(
        [pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas']
    )


@pytest.mark.parametrize(
    ('module', 'first', 'verb', 'given'),
    [
        (diagnose, 'locate', diagnose.diagnose_recording, 2),
        (confirm, 'locate', confirm.confirm_recording, 3),
    ],
)
def test_a_diagnosis_runs_on_one_thread_each(monkeypatch, module, first, verb, given):
    monkeypatch.setattr(module, first, threads)
    with threadpool_limits(2, user_api='blas'):
        with pytest.raises(SeenError) as told:
            verb(*[None] * given)
        assert set(told.value.args[0]) == {1}
        with pytest.raises(SeenError) as told:
            threads()
        assert set(told.value.args[0]) == {2}


def test_what_is_returned_is_handed_on():
    assert one_thread_each(lambda value: value + 1)(2) == 3
