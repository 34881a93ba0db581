"""Draft the instruments section of a machine description for a foreign recording.

The draft names every numeric field: those whose quantity can be guessed as sensors, the rest as
comments. It is for a person to edit: sides, links and units are guesses.
"""

import os

from escalator_twin.bagfile.source import Bag, topics_of
from escalator_twin.suggest.draft import comments_on, head_of, sensors_of
from escalator_twin.suggest.look import loggers_of, look
from escalator_twin.suggest.rules import matches


def suggest(path: str | os.PathLike[str]) -> str:
    """Return a draft of the instruments section, as YAML.

    Raises
    ------
    BagError
        Where the container cannot be read.
    """
    with Bag(path) as bag:
        topics = [look(bag, info) for info in topics_of(bag) if info.n_messages]
    loggers = loggers_of(topics)
    sensors: list[str] = []
    unknown: list[str] = []
    names: set[str] = set()
    for topic in topics:
        rest = list(topic.fields)
        for rule, fields in matches(topic):
            sensors += sensors_of(topic, rule, fields, loggers[topic.info.topic], names)
            rest = [item for item in rest if item not in fields]
        unknown += comments_on(topic, rest)
    return '\n'.join(
        [
            *head_of(topics, loggers),
            '  sensors:' if sensors else '  sensors: []',
            *sensors,
            *unknown,
            '',
        ]
    )


__all__ = ['suggest']
