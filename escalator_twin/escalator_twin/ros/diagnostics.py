"""What the nodes say about themselves on /diagnostics."""

from collections.abc import Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def array(
    stamp: Time, name: str, level: bytes, message: str, values: Mapping[str, object]
) -> DiagnosticArray:
    """Return one status as a message; numbers are shown to six digits."""
    status = DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id='escalator_twin',
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
    )
    result = DiagnosticArray(status=[status])
    result.header.stamp = stamp
    return result


def _text(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
