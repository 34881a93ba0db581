"""Write a recording as a rosbag2 directory with one zstd MCAP, byte for byte reproducible."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]

NS = 10**9
EARLIER_NS = 5 * 10**6  # ns, the experiment's message before the first sample
BAG_VERSION = 9  # rosbag2's metadata version in Jazzy

EXPERIMENT = """std_msgs/Header header
string machine
string case_id
float64 set_speed
int8 direction
float64 load_per_step
float64 preload
string notes
"""
LINK_STRAIN = 'std_msgs/Header header\nstring link\nfloat64[4] strain\n'
DISPLACEMENT = 'std_msgs/Header header\nfloat64 displacement\n'
DEFINITIONS = {
    'escalator_msgs/msg/Experiment': EXPERIMENT,
    'escalator_msgs/msg/LinkStrain': LINK_STRAIN,
    'escalator_msgs/msg/TensionerDisplacement': DISPLACEMENT,
}
IMU = 'sensor_msgs/msg/Imu'
ACCELERATION_VARIANCE = 4.0e-4  # (m/s2)^2, the data sheet's noise of 0.02 m/s2


@dataclass(frozen=True)
class Series:
    """Messages of one topic.

    Attributes
    ----------
    topic, msgtype, frame : names as recorded.
    stamp_ns : (n,) logger's clock.
    bag_ns : (n,) recorder's clock.
    values : (n, columns), SI units.
    """

    topic: str
    msgtype: str
    frame: str
    stamp_ns: IntArray
    bag_ns: IntArray
    values: FloatArray


@dataclass(frozen=True)
class Recording:
    """Everything that goes into one bag."""

    start_ns: int
    case_id: str
    set_speed_m_s: float
    direction: int
    load_kg: float
    preload_n: float
    series: tuple[Series, ...]


class Encoder:
    """Builds messages of the recording's types as CDR bytes."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)
        for name, text in DEFINITIONS.items():
            self.store.register(get_types_from_msg(text, name))
        kinds = self.store.types
        self.kinds = kinds
        self.absent = np.array([-1.0] + [0.0] * 8)
        self.variance = np.diag([ACCELERATION_VARIANCE] * 3).ravel()
        vector = kinds['geometry_msgs/msg/Vector3']
        self.still = vector(x=0.0, y=0.0, z=0.0)
        self.upright = kinds['geometry_msgs/msg/Quaternion'](x=0.0, y=0.0, z=0.0, w=1.0)

    def header(self, stamp_ns: int, frame: str) -> object:
        sec, nanosec = divmod(int(stamp_ns), NS)
        time = self.kinds['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec)
        return self.kinds['std_msgs/msg/Header'](stamp=time, frame_id=frame)

    def experiment(self, recording: Recording) -> bytes:
        message = self.kinds['escalator_msgs/msg/Experiment'](
            header=self.header(recording.start_ns, ''),
            machine='prototype',
            case_id=recording.case_id,
            set_speed=recording.set_speed_m_s,
            direction=recording.direction,
            load_per_step=recording.load_kg,
            preload=recording.preload_n,
            notes='',
        )
        return bytes(self.store.serialize_cdr(message, 'escalator_msgs/msg/Experiment'))

    def row(self, series: Series, i: int) -> bytes:
        header = self.header(series.stamp_ns[i], series.frame)
        values = series.values[i]
        if series.msgtype == IMU:
            x, y, z = (float(v) for v in values)
            message = self.kinds[IMU](
                header=header,
                orientation=self.upright,
                orientation_covariance=self.absent,
                angular_velocity=self.still,
                angular_velocity_covariance=self.absent,
                linear_acceleration=self.kinds['geometry_msgs/msg/Vector3'](x=x, y=y, z=z),
                linear_acceleration_covariance=self.variance,
            )
        elif series.msgtype == 'escalator_msgs/msg/LinkStrain':
            link = series.topic.split('/')[-2]
            message = self.kinds[series.msgtype](header=header, link=link, strain=values)
        else:
            message = self.kinds[series.msgtype](header=header, displacement=float(values[0]))
        return bytes(self.store.serialize_cdr(message, series.msgtype))


def write_bag(recording: Recording, directory: Path) -> None:
    """Write the recording; messages in the order of the recorder's clock."""
    encoder = Encoder()
    directory.parent.mkdir(parents=True, exist_ok=True)
    writer = Writer(directory, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        pass_on = {}
        first = writer.add_connection(
            '/measured/experiment', 'escalator_msgs/msg/Experiment', typestore=encoder.store
        )
        opened = min(int(series.bag_ns[0]) for series in recording.series) - EARLIER_NS
        writer.write(first, opened, encoder.experiment(recording))
        order = []
        for k, series in enumerate(recording.series):
            pass_on[k] = writer.add_connection(
                series.topic, series.msgtype, typestore=encoder.store
            )
            order.extend((bag_ns, k, i) for i, bag_ns in enumerate(series.bag_ns.tolist()))
        for bag_ns, k, i in sorted(order):
            writer.write(pass_on[k], bag_ns, encoder.row(recording.series[k], i))
