"""Names of what is unknown in several recordings of one machine, and where its tolerances are turned."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

EFFECT = 'effect'  # begins the name of an effect's number
OWN = 'experiment.'  # tolerances of what was set for one recording: preload and load

Name = tuple[str, ...]  # of an unknown


def name_of(tolerance: str, r: int) -> Name:
    """Return a tolerance's name: with the recording's number where it is that recording's own."""
    return (tolerance, str(r)) if tolerance.startswith(OWN) else (tolerance,)


def of_recording(turned: Mapping[Name, float], r: int) -> dict[str, float]:
    """Return the tolerances as one recording has them."""
    return {name[0]: z for name, z in turned.items() if name[1:] in ((), (str(r),))}


def mean_of(turned: Sequence[Mapping[str, float]], without: Collection[str]) -> dict[Name, float]:
    """Return the tolerances as recordings by themselves have them: the machine's by their mean.

    Each by itself ended in a hollow of its own; their mean is nearer than no tolerance at all.

    Parameters
    ----------
    turned : sequence of mapping of tolerance to float
        Of every recording, standard deviations; empty where it is not known.
    without : collection of str
        Tolerances that effects stand for: they are in these effects' sizes.

    Returns
    -------
    turned : mapping of name to float
        Standard deviations; of what was set for one recording, its own. Empty where none is known.
    """
    found: dict[Name, list[float]] = {}
    for r, own in enumerate(turned):
        for tolerance, z in own.items():
            if tolerance not in without:
                found.setdefault(name_of(tolerance, r), []).append(z)
    return {name: float(np.mean(ways)) for name, ways in found.items()}


def of_one(
    turned: Sequence[Mapping[str, float]], r: int, without: Collection[str]
) -> dict[Name, float]:
    """Return the tolerances as one recording has the machine's, each what was set for it by itself.

    Parameters are those of `mean_of`, which is what this is of one recording alone; ``r`` is its number.
    """
    alone = [
        own if k == r else {name: z for name, z in own.items() if name.startswith(OWN)}
        for k, own in enumerate(turned)
    ]
    return mean_of(alone, without)
