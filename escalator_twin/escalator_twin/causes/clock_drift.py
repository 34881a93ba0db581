"""The on-board clock drifts against the ground's.

Law
---
Every clock that is not the reference runs at 1 + ppm 1e-6 of the recorder's, in all (what
tolerance it has is part of it): its stamps advance by that much more, and its samples come that
much more often.

Limits
------
A steady rate. Bag time is stamped by the recorder and shows it at once.

Alike
-----
None: speed and chain length act on all loggers alike.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.imperfections import Imperfections
from escalator_twin.machine import Machine


def alter_imperfections(
    imperfections: Imperfections, machine: Machine, _: Location, theta: Theta
) -> Imperfections:
    """Return ``imperfections`` with this drift of every travelling clock."""
    reference = machine.instruments.reference_logger
    clocks = {
        name: clock if name == reference else clock._replace(drift_ppm=theta['ppm'])
        for name, clock in imperfections.clocks.items()
    }
    return replace(imperfections, clocks=clocks)


CAUSE = Cause(
    name='clock_drift',
    law="drift of the on-board clock against the ground's, in all",
    parameters=(Parameter('ppm', '1e-6', -1e5, 1e5, neutral=0.0, tolerance=20.0),),
    places=(),
    references=({'ppm': 900.0},),
    acts_on=('link_force', 'step_acceleration'),
    locked_to=('time',),
    alter_imperfections=alter_imperfections,
)
