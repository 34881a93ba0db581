"""Whether a recording ran the way that its experiment topic says."""

from escalator_twin.case import BESIDE
from escalator_twin.errors import SynchronisationError
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording
from escalator_twin.sync.place import Place

# Squared correlation, in the mean of links and steps, from which the direction is not asked; below the second, and above
# the third for the other direction, a channel says that it is wrong. Of a labelled recording told the wrong way forces
# had 0.12, the right way 1.00; the tensioner is alike both ways.
LEAST_AGREED, DENIED, CLAIMED = 0.7, 0.5, 0.9
TELL_DIRECTION = ('link_force', 'step_acceleration')


def _telling(place: Place, machine: Machine) -> dict[str, float]:
    """Return the agreement of the channels that tell the direction."""
    quantity = {s.channel: s.quantity for s in machine.instruments.sensors}
    return {c: r2 for c, r2 in place.agreement.items() if quantity[c] in TELL_DIRECTION}


def tells_little(place: Place, machine: Machine) -> bool:
    """Tell whether a recording agrees so little where it was placed that its direction is asked."""
    told = [*_telling(place, machine).values()]
    return bool(told) and sum(told) / len(told) < LEAST_AGREED


def require_direction(recording: Recording, machine: Machine, place: Place, turned: Place) -> None:
    """Refuse a recording whose channels are those of a machine that runs the other way.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    place, turned : Place
        As the experiment topic says, and the other way.

    Raises
    ------
    SynchronisationError
    """
    as_said, as_turned = (_telling(p, machine) for p in (place, turned))
    denied = [c for c in as_said if as_said[c] < DENIED and as_turned[c] > CLAIMED]
    if not denied or any(as_turned[c] < DENIED and as_said[c] > CLAIMED for c in as_said):
        return
    assert recording.experiment is not None
    said, runs = ('up', 'down') if recording.experiment.direction > 0 else ('down', 'up')
    worst = min(denied, key=lambda c: as_said[c])
    raise SynchronisationError(
        f'{recording.path}: the experiment topic says {said}, and the channels that the machine runs {runs}: '
        f'{worst} agrees with the twin by {as_said[worst]:.2f} (squared correlation), with one that runs '
        f'{runs} by {as_turned[worst]:.2f}; `direction` in a file {BESIDE} in its directory puts it right'
    )
