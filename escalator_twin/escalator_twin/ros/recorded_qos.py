"""The quality of service that a recording's publishers offered."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from rclpy.qos import QoSProfile
import yaml

from escalator_twin.ros import qos

METADATA = 'metadata.yaml'
# rmw's numbers, as older versions of rosbag2 write them
RELIABILITY = {'1': 'reliable', '2': 'best_effort'}
DURABILITY = {'1': 'transient_local', '2': 'volatile'}


def recorded_qos(path: str) -> dict[str, QoSProfile]:
    """Return the profiles of a bag's topics; a topic whose profile is not told is left out.

    Parameters
    ----------
    path : str
        A rosbag2 directory, or a file of it.
    """
    place = Path(path)
    texts = _from_metadata(place / METADATA) if place.is_dir() else _from_mcap(place)
    found = {}
    for topic, offered in texts.items():
        profiles = _profiles(offered)
        if profiles:
            found[topic] = _profile(profiles[0])
    return found


def _from_metadata(file: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(file.read_bytes())
        topics = data['rosbag2_bagfile_information']['topics_with_message_count']
        return {
            entry['topic_metadata']['name']: entry['topic_metadata'].get('offered_qos_profiles')
            for entry in topics
        }
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError):
        return {}


def _from_mcap(file: Path) -> dict[str, Any]:
    try:
        with file.open('rb') as stream:
            summary = make_reader(stream).get_summary()
    except (OSError, McapError, ValueError, EOFError):
        return {}
    if summary is None:
        return {}
    return {
        channel.topic: channel.metadata.get('offered_qos_profiles')
        for channel in summary.channels.values()
    }


def _profiles(offered: Any) -> list[Mapping[str, Any]]:
    """Return profiles from a list, or from the YAML text of one."""
    if isinstance(offered, str):
        try:
            offered = yaml.safe_load(offered)
        except yaml.YAMLError:
            return []
    if not isinstance(offered, list):
        return []
    return [entry for entry in offered if isinstance(entry, Mapping)]


def _profile(entry: Mapping[str, Any]) -> QoSProfile:
    reliability, durability = str(entry.get('reliability')), str(entry.get('durability'))
    return qos.samples_like(
        RELIABILITY.get(reliability, reliability), DURABILITY.get(durability, durability)
    )
