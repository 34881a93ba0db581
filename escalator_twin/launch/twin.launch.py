"""Simulator and comparator together.

``ros2 launch escalator_twin twin.launch.py bag:=PATH`` replays a recording beside the twin;
without ``bag`` the comparator listens to the measured topics.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

MACHINE = 'config/machines/prototype.yaml'
# name, default, type, description
COMPARATOR = (
    ('bag', '', str, 'recording to replay; empty: listen to the measured topics'),
    ('rate', '1.0', float, 'replayed over wall time; 0: as fast as possible'),
    ('start_offset_s', '0.0', float, 'what of the recording is left out at its start, s'),
    ('loop', 'false', bool, 'replay again and again'),
    ('window_s', '0.0', float, 'time between two comparisons, s; 0: one whole loop'),
    ('json', '', str, 'file for the result'),
    ('session', '', str, 'directory to make for the session as a recording'),
)
SIMULATOR = (
    ('markers', 'false', bool, 'publish steps, links and carriage for RViz'),
    ('publish_clock', 'false', bool, 'publish simulated time on /clock'),
)


def values(entries: tuple[tuple[str, str, type, str], ...]) -> dict[str, ParameterValue]:
    """Return launch arguments as parameters of the type that the node declares."""
    return {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, _, kind, _ in entries
    }


def generate_launch_description() -> LaunchDescription:
    """Return both nodes; the launch ends with the comparator."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, _, text in (
            ('machine', MACHINE, str, 'YAML file that describes the machine'),
            *COMPARATOR,
            *SIMULATOR,
            ('exit', 'true', bool, 'end when the replay has been compared'),
        )
    ]
    machine = {'machine': ParameterValue(LaunchConfiguration('machine'), value_type=str)}
    at_end = {'exit_at_end': ParameterValue(LaunchConfiguration('exit'), value_type=bool)}
    return LaunchDescription(
        [
            *arguments,
            Node(
                package='escalator_twin',
                executable='simulator',
                name='simulator',
                output='screen',
                parameters=[machine, {'autostart': False}, values(SIMULATOR)],
            ),
            Node(
                package='escalator_twin',
                executable='comparator',
                name='comparator',
                output='screen',
                parameters=[machine, at_end, values(COMPARATOR)],
                on_exit=Shutdown(reason='the comparison has ended'),
            ),
        ]
    )
