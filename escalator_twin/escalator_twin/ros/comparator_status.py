"""How the comparator is, in words and figures."""

from escalator_twin.ros.comparing import Comparing
from escalator_twin.ros.diagnostics import ERROR, OK


def level_of(comparing: Comparing) -> tuple[bytes, str]:
    """Return how the comparison is, and a word on it."""
    run = comparing.link.run
    if run.n_lost or run.n_disordered:
        return ERROR, 'simulated messages were lost'
    return OK, comparing.state


def values_of(comparing: Comparing) -> dict[str, object]:
    """Return the comparison's figures."""
    run = comparing.link.run
    return {
        'state': comparing.state,
        'machine': comparing.machine_path,
        'measured messages': comparing.n_measured,
        'simulated messages': run.n_received,
        'simulated messages lost': run.n_lost,
        'simulated messages out of order': run.n_disordered,
        'simulated time (s)': comparing.link.time_s,
        'comparisons': comparing.n_compared,
    }
