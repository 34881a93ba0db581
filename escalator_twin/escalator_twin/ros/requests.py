"""Services' requests and responses as values."""

from builtin_interfaces.msg import Time

from escalator_msgs.srv import StartExperiment
from escalator_twin.comparison.locate import LEAD_S, RATE_HZ, Setting
from escalator_twin.errors import ExperimentError
from escalator_twin.machine import Machine
from escalator_twin.ros.outputs import NS
from escalator_twin.ros.run import Order
from escalator_twin.signals import Experiment


def time_message(time_ns: int) -> Time:
    """Return a time as a message."""
    seconds, nanoseconds = divmod(time_ns, NS)
    return Time(sec=seconds, nanosec=nanoseconds)


def time_ns(message: Time) -> int:
    """Return a message's time, nanoseconds."""
    return int(message.sec) * NS + int(message.nanosec)


def order_of(request: StartExperiment.Request, machine: Machine, epoch_ns: int) -> Order:
    """Return what a request asks for.

    Raises
    ------
    ExperimentError
        Naming the field that cannot be.
    """
    loads = tuple(float(load) for load in request.load_per_step)
    n_steps = machine.chain.n_links
    if len(loads) not in (1, n_steps):
        raise ExperimentError(
            f'load_per_step: expected one value or {n_steps}, found {len(loads)} values'
        )
    if not request.duration >= 0.0:
        raise ExperimentError(f'duration: expected 0 or more, found {request.duration!r} s')
    if not request.ahead >= 0.0:
        raise ExperimentError(f'ahead: expected 0 or more, found {request.ahead!r} s')
    return Order(
        Experiment(
            request.set_speed,
            int(request.direction),
            loads,
            request.preload,
            machine=machine.name,
        ),
        request.start_s,
        request.duration,
        time_ns(request.stamp) or epoch_ns,
        request.sample_rate,
        request.real_time_factor,
        request.listener,
        request.ahead,
    )


def request_of(
    setting: Setting, rate: float, listener: str, ahead_s: float = 0.0
) -> StartExperiment.Request:
    """Return the request for a run beside a recording.

    Parameters
    ----------
    setting : Setting
        Of the recording.
    rate : float
        Simulated over wall time; 0: as fast as possible.
    listener : str
        Whom the run waits for.
    ahead_s : float
        How far it runs ahead of him, without end; 0: as far as it can, to the recording's end.
    """
    experiment = setting.experiment
    return StartExperiment.Request(
        set_speed=experiment.set_speed_m_s,
        direction=experiment.direction,
        load_per_step=list(experiment.load_per_step_kg),
        preload=experiment.preload_n,
        start_s=setting.start_s_m,
        duration=0.0 if ahead_s else setting.duration_s,
        stamp=time_message(setting.origin_ns - round(LEAD_S * NS)),
        sample_rate=RATE_HZ,
        real_time_factor=rate or -1.0,
        listener=listener,
        ahead=ahead_s,
    )
