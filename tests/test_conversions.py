"""Field paths and conversions, alike on the messages of every library."""

from dataclasses import replace
import io
from types import SimpleNamespace

from makers import mcap_bytes, message, prototype, raw, stamp, STORE
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest

from escalator_twin.conversions import (
    experiment_of,
    experiment_values,
    fill,
    get_field,
    parse_path,
    parts_of,
    path_text,
    set_field,
    set_stamp,
    stamp_ns,
)
from escalator_twin.errors import ExperimentError, MachineError
from escalator_twin.signals import Experiment

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
TIME = 1_790_000_000_123_456_789


@pytest.mark.parametrize(
    ('text', 'path'),
    [
        ('displacement', ('displacement',)),
        ('strain[0]', ('strain', 0)),
        ('linear_acceleration.x', ('linear_acceleration', 'x')),
        ('poses[2].position.y', ('poses', 2, 'position', 'y')),
        ('grid[1][2]', ('grid', 1, 2)),
    ],
)
def test_field_paths(text, path):
    assert parse_path(text) == path
    assert path_text(path) == text


@pytest.mark.parametrize(
    'text', ['', '.', 'a.', '.a', '[0]', 'a[', 'a[x]', 'a[-1]', 'a b', 'a..b', '1a']
)
def test_what_is_no_field_path(text):
    with pytest.raises(MachineError, match='expected a form like'):
        parse_path(text)


def strain_message():
    made = message(
        'escalator_msgs/msg/LinkStrain', link='left_a', strain=1e-6 * np.arange(1.0, 5.0)
    )
    return stamp(made, TIME)


def decoded_by_mcap(made, kind):
    """Return the message as mcap_ros2 decodes it."""
    data = mcap_bytes([raw('/t', kind, 1, made)])
    reader = make_reader(io.BytesIO(data), decoder_factories=[DecoderFactory()])
    ((_, _, _, decoded),) = reader.iter_decoded_messages()
    return decoded


def as_rclpy(made):
    """Return what rclpy's classes look like: attributes, arrays for fixed sequences."""
    header = SimpleNamespace(
        stamp=SimpleNamespace(sec=made.header.stamp.sec, nanosec=made.header.stamp.nanosec),
        frame_id='',
    )
    return SimpleNamespace(header=header, link=made.link, strain=np.array(made.strain))


@pytest.mark.parametrize('library', ['rosbags', 'mcap_ros2', 'rclpy'])
def test_numbers_of_every_librarys_messages(library):
    made = strain_message()
    kind = 'escalator_msgs/msg/LinkStrain'
    seen = {
        'rosbags': lambda: STORE.deserialize_cdr(raw('/t', kind, 1, made).data, kind),
        'mcap_ros2': lambda: decoded_by_mcap(made, kind),
        'rclpy': lambda: as_rclpy(made),
    }[library]()
    sensor = MACHINE.instruments.sensor('link_force/left_a')
    assert stamp_ns(seen) == TIME
    assert parts_of(seen, sensor) == pytest.approx([75.6, 151.2, 226.8, 302.4])
    assert get_field(seen, ('link',)) == 'left_a'
    with pytest.raises(KeyError, match='strain'):
        get_field(seen, ('strain', 4))
    with pytest.raises(KeyError, match='stress'):
        get_field(seen, ('stress',))


def test_filling_is_the_inverse():
    sensor = replace(MACHINE.instruments.sensor('link_force/left_a'), sign=-1.0, offset=3.0)
    made = as_rclpy(strain_message())
    fill(made, sensor, [10.0, 20.0, 30.0, 40.0])
    set_stamp(made, 5_000_000_007)
    assert parts_of(made, sensor) == pytest.approx([10.0, 20.0, 30.0, 40.0])
    assert made.strain[0] == pytest.approx((10.0 - 3.0) / -7.56e7)
    assert made.link == 'left_a'
    assert (made.header.stamp.sec, made.header.stamp.nanosec) == (5, 7)
    assert stamp_ns(made) == 5_000_000_007


def test_fields_keep_their_type_and_lists_grow():
    made = SimpleNamespace(axle=0, data=[], name='a')
    set_field(made, ('axle',), 3.0)
    set_field(made, ('data', 1), 2.5)
    set_field(made, ('name',), 'b')
    assert made == SimpleNamespace(axle=3, data=[0.0, 2.5], name='b')
    assert type(made.axle) is int


def test_a_message_without_header_has_no_time():
    assert stamp_ns(message('std_msgs/msg/Float64', data=1.0)) is None
    set_stamp(message('std_msgs/msg/Float64'), 1)


def test_experiments_go_both_ways():
    experiment = Experiment(0.25, -1, (75.0,), 6000.0, 'case', 'prototype', 'note')
    made = message('escalator_msgs/msg/Experiment')
    for path, value in experiment_values(experiment).items():
        set_field(made, path, value)
    assert experiment_of(made) == experiment


def test_a_load_per_step_is_told_as_its_mean():
    values = experiment_values(Experiment(0.25, 1, (0.0, 30.0), 6000.0))
    assert values[('load_per_step',)] == 15.0


def test_an_impossible_experiment_is_refused():
    with pytest.raises(ExperimentError, match='direction'):
        experiment_of(message('escalator_msgs/msg/Experiment', set_speed=0.5))
    with pytest.raises(KeyError, match='set_speed'):
        experiment_of(SimpleNamespace())
