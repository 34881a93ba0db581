"""A step of a fit whose parts are run several at a time: the same is taken as one by one."""

import threading

import pytest

from escalator_twin.diagnosis.joint import first_few

pytestmark = pytest.mark.issue(6)

WAYS = [(1.0, 1.0), (0.4, 1.0), (0.15, 1.0), (1.0, 0.0), (0.4, 0.0)]


@pytest.mark.parametrize('jobs', [1, 2, 3])
@pytest.mark.parametrize('taken', range(len(WAYS)))
def test_ways_come_in_their_order_and_no_more_are_run_than_a_batch(jobs, taken):
    ran = []

    def work(share, along):
        ran.append((share, along))
        return share + along

    for k, (way, value) in enumerate(first_few(work, WAYS, jobs)):
        assert way == WAYS[k]
        assert value == sum(way)
        if k == taken:
            break
    # the first by itself: most steps end there
    batches = 0 if taken == 0 else -(-taken // jobs)
    # what was not begun when no more was asked for is not run
    assert set(WAYS[: 1 + taken]) <= set(ran) <= set(WAYS[: 1 + batches * jobs])


def test_parts_are_run_at_the_same_time():
    both = threading.Barrier(2, timeout=20.0)

    def work(share, _):
        if share < 1.0:
            both.wait()
        return share

    assert [value for _, value in first_few(work, WAYS[:3], 2)] == [1.0, 0.4, 0.15]


def test_what_one_part_raises_is_raised_where_it_is_asked_for():
    class NoRunError(Exception):
        pass

    def work(share, _):
        if share < 0.4:
            raise NoRunError
        return share

    found = first_few(work, WAYS[:3], 2)
    assert [next(found)[1], next(found)[1]] == [1.0, 0.4]
    with pytest.raises(NoRunError):
        next(found)
