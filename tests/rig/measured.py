"""Read a recording of another maker back into the instruments' quantities."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from rig.bagfile import IMU, NS
from rig.instruments import JITTER_S, LATENCY_S, LINKS
from rig.machine import Case
from rig.sheet import Sheet

FloatArray = NDArray[np.float64]

MEAN_LATENCY_S = LATENCY_S + JITTER_S * np.sqrt(2.0 / np.pi)  # s, of LATENCY_S + |N(0, JITTER_S)|


ROW_OF = {  # how each type's row of numbers is read
    'escalator_msgs/msg/LinkStrain': lambda message: message.strain,
    'escalator_msgs/msg/TensionerDisplacement': lambda message: message.displacement,
    IMU: lambda message: [getattr(message.linear_acceleration, axis) for axis in 'xyz'],
}


@dataclass(frozen=True)
class Measured:
    """One recording on the recorder's clock, which starts at the first ground sample.

    Attributes
    ----------
    onboard_s, ground_s : (n,), (n_ground,) s.
    force : (4 links, n) N, EA times the mean of the four strains, zeros included.
    displacement : (n_ground,) m.
    acceleration : (3, n) m/s2.
    """

    name: str
    case: Case
    onboard_s: FloatArray
    ground_s: FloatArray
    force: FloatArray
    displacement: FloatArray
    acceleration: FloatArray


def on_recorder_clock(stamp_ns: list[int], bag_ns: list[int], origin_ns: int) -> FloatArray:
    """Return when the samples were taken (s), by a straight line from stamps to bag times."""
    stamp = np.array(stamp_ns, np.int64)
    own = (stamp - stamp[0]) * 1e-9
    late = (np.array(bag_ns, np.int64) - stamp) * 1e-9
    line = np.polynomial.Polynomial.fit(own, late, 1)
    return (stamp - origin_ns) * 1e-9 + line(own) - MEAN_LATENCY_S


def read_measured(path: Path) -> Measured:
    """Read a rosbag2 directory with the prototype's topics."""
    stamps: dict[str, list[int]] = {}
    bags: dict[str, list[int]] = {}
    values: dict[str, list] = {}
    case = None
    with AnyReader([path]) as reader:
        for connection, bag_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            name = connection.topic.removeprefix('/').partition('/')[2]  # measured or simulated
            if name == 'experiment':
                case = Case(
                    message.set_speed,
                    int(message.direction),
                    message.load_per_step,
                    message.preload,
                )
                continue
            read = ROW_OF.get(connection.msgtype)
            if read is None:  # something beside the instruments
                continue
            row = read(message)
            stamp = message.header.stamp
            stamps.setdefault(name, []).append(stamp.sec * NS + stamp.nanosec)
            bags.setdefault(name, []).append(bag_ns)
            values.setdefault(name, []).append(row)
    if case is None:
        raise ValueError(f'{path}: no message on an experiment topic')
    origin = stamps['tensioner/displacement'][0]
    one = 'link/left_a/strain'
    section = Sheet().section_stiffness_n
    force = [section * np.mean(values[f'link/{link}/strain'], axis=1) for link in LINKS]
    return Measured(
        path.name,
        case,
        on_recorder_clock(stamps[one], bags[one], origin),
        on_recorder_clock(
            stamps['tensioner/displacement'], bags['tensioner/displacement'], origin
        ),
        np.stack(force),
        np.array(values['tensioner/displacement']),
        np.array(values['step/acceleration']).T,
    )
