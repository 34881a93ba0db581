"""Recordings in files: rosbag2 directories and bare MCAP files, read and written without ROS.

`read` gives the machine's channels, `topics` what is there at all, `messages` the serialised
messages in order, `write` makes a bag.
"""

from escalator_twin.bagfile.ordering import Message, messages
from escalator_twin.bagfile.reading import read, require
from escalator_twin.bagfile.source import TopicInfo, topics
from escalator_twin.bagfile.writing import check_target, write

__all__ = [
    'Message',
    'TopicInfo',
    'check_target',
    'messages',
    'read',
    'require',
    'topics',
    'write',
]
