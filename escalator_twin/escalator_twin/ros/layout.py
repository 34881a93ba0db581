"""A layout for Foxglove and Lichtblick: every channel, measured over simulated."""

import json
from pathlib import Path
from typing import Any

from escalator_twin.machine import Machine

MEASURED, SIMULATED = '#d1495b', '#2e6f95'
Node = dict[str, Any] | str


def aligned_topic(channel: str) -> str:
    """Return the topic of a channel's aligned samples in a session."""
    return f'/comparator/aligned/{channel}'


def layout(machine: Machine) -> dict[str, Any]:
    """Return a layout with a plot a channel, two columns of them."""
    channels = [sensor.channel for sensor in machine.instruments.sensors]
    plots = {f'Plot!{i}': _plot(channel) for i, channel in enumerate(channels)}
    names = list(plots)
    columns = [_stack(part, 'column') for part in (names[::2], names[1::2]) if part]
    return {
        'configById': plots,
        'globalVariables': {},
        'userNodes': {},
        'playbackConfig': {'speed': 1},
        'layout': _stack(columns, 'row'),
    }


def write_layout(session: Path, machine: Machine) -> Path:
    """Write the layout beside a session and return where."""
    path = session.with_name(f'{session.name}.foxglove.json')
    path.write_text(json.dumps(layout(machine), indent=1) + '\n', encoding='utf-8')
    return path


def _plot(channel: str) -> dict[str, Any]:
    topic = aligned_topic(channel)
    return {
        'title': channel,
        'paths': [
            {
                'value': f'{topic}.{field}',
                'label': field,
                'color': colour,
                'enabled': True,
                'timestampMethod': 'receiveTime',
                'showLine': True,
                'lineSize': 1,
            }
            for field, colour in (('measured', MEASURED), ('simulated', SIMULATED))
        ],
        'showLegend': True,
        'legendDisplay': 'floating',
        'isSynced': True,
        'xAxisVal': 'timestamp',
        'showXAxisLabels': True,
        'showYAxisLabels': True,
    }


def _stack(parts: list[Any], direction: str) -> Node:
    """Return parts beside or above one another, all of one size."""
    if len(parts) == 1:
        return parts[0]
    return {
        'direction': direction,
        'splitPercentage': 100.0 / len(parts),
        'first': parts[0],
        'second': _stack(parts[1:], direction),
    }
