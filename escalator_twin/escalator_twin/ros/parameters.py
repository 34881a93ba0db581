"""Settings as ROS parameters."""

from collections.abc import Callable
from dataclasses import fields
from typing import TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from escalator_twin.errors import EscalatorError
from escalator_twin.ros.settings import check, Settings, SettingsError

Kind = TypeVar('Kind', bound=Settings)


def declare(node: Node, kind: type[Kind]) -> Kind:
    """Declare a dataclass of settings as parameters and return what they are set to.

    A whole number is accepted where a number is expected: ``rate:=10``.

    Raises
    ------
    SettingsError
        On the first value that its description does not allow.
    """
    values = {}
    for entry in fields(kind):
        about = entry.metadata
        descriptor = ParameterDescriptor(
            description=about['doc'], read_only=not about['is_live'], dynamic_typing=True
        )
        if about['low'] is not None:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(about['low']), to_value=float(about['high']))
            ]
            descriptor.additional_constraints = f'{about["low"]:g} to {about["high"]:g}'
        try:
            value = node.declare_parameter(entry.name, entry.default, descriptor).value
        except InvalidParameterValueException as error:
            raise SettingsError(
                f'{entry.name}: expected {about["low"]:g} to {about["high"]:g}, '
                f'found {_override(node, entry.name)!r}'
            ) from error
        values[entry.name] = check(entry.name, value, entry.default, about['low'], about['high'])
    return kind(**values)


def follow(node: Node, kind: type[Settings], on_change: Callable[[str, object], None]) -> None:
    """Call ``on_change(name, value)`` for each live parameter that somebody sets.

    It may refuse by an EscalatorError.
    """
    live = {entry.name: entry for entry in fields(kind) if entry.metadata['is_live']}

    def set_all(parameters: list[Parameter]) -> SetParametersResult:
        changes = {}
        for parameter in parameters:
            if parameter.name not in live:
                continue
            entry = live[parameter.name]
            about = entry.metadata
            try:
                changes[entry.name] = check(
                    entry.name, parameter.value, entry.default, about['low'], about['high']
                )
            except SettingsError as error:
                return SetParametersResult(successful=False, reason=str(error))
        try:
            for name, value in changes.items():
                on_change(name, value)
        except EscalatorError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(set_all)


def _override(node: Node, name: str) -> object:
    """Return the value that was asked for."""
    return node._parameter_overrides[name].value  # rclpy has no other way to it
