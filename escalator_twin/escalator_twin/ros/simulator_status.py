"""How the simulator is, in words and figures."""

from escalator_twin.ros.diagnostics import ERROR, OK, WARN
from escalator_twin.ros.engine import Engine
from escalator_twin.ros.sender import Sender

SLOW = 0.9  # of the real-time factor asked for: less is worth a warning


def level_of(engine: Engine, sender: Sender) -> tuple[bytes, str]:
    """Return how the simulation is, and a word on it."""
    run = engine.run_now
    if engine.trouble:
        return ERROR, engine.trouble
    if sender.failed or sender.unacknowledged:
        return ERROR, 'messages were not taken'
    if run is None:
        return OK, 'waiting for an experiment'
    if run.is_paused:
        return OK, 'paused'
    if run.is_done:
        return OK, 'the experiment is over'
    achieved = run.achieved()
    if achieved and achieved < SLOW * engine.pace_of(run):
        return WARN, 'slower than asked for'
    return OK, 'running'


def values_of(engine: Engine, sender: Sender) -> dict[str, object]:
    """Return the simulation's figures."""
    run = engine.run_now
    values: dict[str, object] = {
        'messages sent': sender.sent,
        'messages not taken': sender.failed + sender.unacknowledged,
    }
    if run is not None:
        values |= {
            'real-time factor asked for': engine.pace_of(run) or 'as fast as possible',
            'real-time factor achieved': run.achieved(),
            'simulated time (s)': run.time_s,
            'speed (m/s)': run.order.experiment.set_speed_m_s,
            'direction': run.order.experiment.direction,
            'waits for': run.order.listener or 'nobody',
        }
    return values
