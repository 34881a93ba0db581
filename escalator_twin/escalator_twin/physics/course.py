"""The closed way of axle 0, whatever the kind of machine."""

from dataclasses import dataclass

from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody.guide import chain_track
from escalator_twin.physics.path import build_path


@dataclass(frozen=True)
class Course:
    """Lengths of the loop and of its passenger run, m."""

    length_m: float
    passenger_m: float


def course_of(machine: Machine) -> Course:
    """Return the way of axle 0 as designed."""
    if isinstance(machine, MultibodyMachine):
        track = chain_track(machine)
        return Course(track.length_m, track.passenger_m)
    path = build_path(machine.guide)
    return Course(path.length_m, path.passenger_m)
