"""The causes of contracts.md: what may be wrong with a machine or with its measurement."""

from escalator_twin.causes.application import (
    alter_imperfections,
    alter_layout,
    alter_machine,
    alter_parameters,
    alter_recording,
    apply,
    check,
)
from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.registry import (
    CAUSES,
    FREE_BODY_CAUSES,
    KNOWN,
    MACHINE_CAUSES,
    MEASUREMENT_CAUSES,
)

__all__ = [
    'CAUSES',
    'FREE_BODY_CAUSES',
    'KNOWN',
    'MACHINE_CAUSES',
    'MEASUREMENT_CAUSES',
    'Cause',
    'Location',
    'Parameter',
    'Theta',
    'alter_imperfections',
    'alter_layout',
    'alter_machine',
    'alter_parameters',
    'alter_recording',
    'apply',
    'check',
]
