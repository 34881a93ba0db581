"""The upper landing is laid longer, or shorter, on both runs.

Law
---
The straight segments between upper transition and upper turnaround are longer by delta_m on both
runs; the turnaround moves out by as much, and the loop is longer by twice that. The carriage
comes in by delta_m, the polygon meets the upper curves delta_m / pitch of a period later, and the
places of surveyed height, drive and load stay where they are on their rails: path coordinates remain
those of the design path, the longer landing being mapped evenly on the designed one. The lateral line
is one of the rollers' own way: past the upper turnaround it comes 2 delta_m later. So it is in the
recordings of other makers (docs/causes.md).

Limits
------
Level and straight; both runs alike.

Alike
-----
``chain_elongation`` of both sides, which also takes up length.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import LANDING
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.path import build_path, LENGTH, START
from escalator_twin.signals import Floats


def alter_parameters(
    parameters: Parameters, machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with the upper landings longer."""
    if theta['delta_m'] == 0.0:
        return parameters
    segments = build_path(machine.guide, theta['delta_m']).segments
    lateral = on_own_way(parameters.lateral, segments, parameters.length_m)
    return parameters._replace(segments=segments, lateral=lateral)


def on_own_way(table: Floats, segments: Floats, length_m: float) -> Floats:
    """Return a table by the rollers' own way as one by coordinates of the design path.

    Parameters
    ----------
    table : (m, n, 2) float64
        At ``i * length_m / n`` of the way.
    segments : (k, columns) float64
        Of the longer guide.
    length_m : float
        Of the design path.
    """
    design = np.append(segments[:, START], length_m)
    way = np.append(0.0, np.cumsum(segments[:, LENGTH]))
    grid = np.arange(table.shape[1]) * length_m / table.shape[1]
    at = np.interp(grid, design, way)
    found = np.empty_like(table)
    for row, old in zip(found, table, strict=True):
        for column in range(table.shape[2]):
            row[:, column] = np.interp(at, grid, old[:, column], period=length_m)
    return found


CAUSE = Cause(
    name='landing_length',
    law='the upper landing laid longer (+) or shorter, both runs',
    parameters=(Parameter('delta_m', 'm', -0.1, 0.1, neutral=0.0, tolerance=1e-3),),
    places=(LANDING,),
    references=({'delta_m': 6e-3},),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel', 'guide'),
    alike=('chain_elongation',),
    alter_parameters=alter_parameters,
)
