"""Services' requests and responses as values."""

from builtin_interfaces.msg import Time

from escalator_msgs.srv import StartExperiment
from escalator_twin.comparison.locate import RATE_HZ, Setting
from escalator_twin.errors import ExperimentError
from escalator_twin.machine import Machine
from escalator_twin.ros.engine import Order
from escalator_twin.ros.outputs import NS
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
    if not request.head_start >= 0.0:
        raise ExperimentError(f'head_start: expected 0 or more, found {request.head_start!r} s')
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
        request.head_start,
        request.listener,
    )


def request_of(
    setting: Setting,
    lead_s: float,
    rate: float,
    listener: str,
    head_start_s: float = 0.0,
    is_endless: bool = False,
) -> StartExperiment.Request:
    """Return the request for a run beside a recording.

    Parameters
    ----------
    setting : Setting
    lead_s : float
        By how much the run begins before the reference clock's time zero.
    rate : float
        Simulated over wall time; 0: as fast as possible.
    listener : str
    head_start_s : float
        What is simulated at once.
    is_endless : bool
        Whether the run goes on past the recording.
    """
    experiment = setting.experiment
    return StartExperiment.Request(
        set_speed=experiment.set_speed_m_s,
        direction=experiment.direction,
        load_per_step=list(experiment.load_per_step_kg),
        preload=experiment.preload_n,
        start_s=setting.start_s_m,
        duration=0.0 if is_endless else setting.duration_s,
        stamp=time_message(setting.origin_ns - round(lead_s * NS)),
        sample_rate=RATE_HZ,
        real_time_factor=rate or -1.0,
        head_start=head_start_s,
        listener=listener,
    )
