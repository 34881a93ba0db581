"""Read a recording of another maker back into the instruments' quantities."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from rig.bagfile import IMU, NS, Recording, Series
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


def on_recorder_clock(series: Series, origin_ns: int) -> FloatArray:
    """Return when the samples were taken (s), by a straight line from stamps to bag times."""
    own = (series.stamp_ns - series.stamp_ns[0]) * 1e-9
    late = (series.bag_ns - series.stamp_ns) * 1e-9
    line = np.polynomial.Polynomial.fit(own, late, 1)
    return (series.stamp_ns - origin_ns) * 1e-9 + line(own) - MEAN_LATENCY_S


def read_recording(path: Path) -> Recording:
    """Read a rosbag2 directory with the prototype's topics as it was recorded."""
    rows: dict[str, list] = {}
    kinds: dict[str, tuple[str, str]] = {}
    head = None
    with AnyReader([path]) as reader:
        for connection, bag_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.msgtype == 'escalator_msgs/msg/Experiment':
                head = message
                continue
            read = ROW_OF.get(connection.msgtype)
            if read is None:  # something beside the instruments
                continue
            stamp = message.header.stamp
            kinds[connection.topic] = (connection.msgtype, message.header.frame_id)
            rows.setdefault(connection.topic, []).append(
                (stamp.sec * NS + stamp.nanosec, bag_ns, np.atleast_1d(read(message)))
            )
    if head is None:
        raise ValueError(f'{path}: no message on an experiment topic')
    series = []
    for topic, taken in rows.items():
        stamp_ns, bag_ns, values = zip(*taken, strict=True)
        series.append(
            Series(
                topic,
                *kinds[topic],
                np.array(stamp_ns, np.int64),
                np.array(bag_ns, np.int64),
                np.array(values, float),
            )
        )
    return Recording(
        head.header.stamp.sec * NS + head.header.stamp.nanosec,
        head.case_id,
        head.set_speed,
        int(head.direction),
        head.load_per_step,
        head.preload,
        tuple(series),
    )


def read_measured(path: Path) -> Measured:
    """Read a rosbag2 directory with the prototype's topics into quantities."""
    recording = read_recording(path)
    of = {one.topic.removeprefix('/').partition('/')[2]: one for one in recording.series}
    strain = [of[f'link/{link}/strain'] for link in LINKS]
    ground = of['tensioner/displacement']
    origin = ground.stamp_ns[0]
    section = Sheet().section_stiffness_n
    return Measured(
        path.name,
        Case(recording.set_speed_m_s, recording.direction, recording.load_kg, recording.preload_n),
        on_recorder_clock(strain[0], origin),
        on_recorder_clock(ground, origin),
        np.stack([section * one.values.mean(axis=1) for one in strain]),
        ground.values[:, 0],
        of['step/acceleration'].values.T,
    )
