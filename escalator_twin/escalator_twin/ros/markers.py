"""The simulated machine as markers for RViz."""

from collections.abc import Sequence

from geometry_msgs.msg import Point
import numpy as np
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from escalator_twin.physics.multibody.simulation import MultibodySimulation
from escalator_twin.physics.path import point_at
from escalator_twin.signals import Floats
from escalator_twin.twin import AnySimulation

LINE_M = 0.03
STEP_COLOUR = ColorRGBA(r=0.45, g=0.5, b=0.55, a=1.0)
LINK_COLOUR = ColorRGBA(r=0.9, g=0.55, b=0.1, a=1.0)
CARRIAGE_COLOUR = ColorRGBA(r=0.15, g=0.45, b=0.8, a=1.0)


def axle_ends(simulation: AnySimulation) -> Floats:
    """Return where the axles' ends are on the design path, (2 sides, n, xyz) in m."""
    if isinstance(simulation, MultibodySimulation):
        return free_axle_ends(simulation)
    parameters, state = simulation.parameters, simulation.state
    half = simulation.machine.chain.track_gauge_m / 2.0
    outward = float(simulation.data.qpos[0])
    sides, n = state.s.shape
    ends = np.empty((2, n, 3))
    for side in range(2):
        for i in range(n):
            s = float(state.s[min(side, sides - 1), i])
            x, z, _, _ = point_at(parameters.segments, parameters.length_m, s, outward)
            ends[side, i] = x, half - 2.0 * half * side, z
    return ends


def free_axle_ends(simulation: MultibodySimulation) -> Floats:
    """Return the same of chain rollers that are bodies of their own, where they are."""
    n = simulation.machine.chain.n_links
    half = simulation.machine.chain.track_gauge_m / 2.0
    place = simulation.data.qpos[: 3 * n].reshape(n, 3)
    ends = np.empty((2, n, 3))
    for side in range(2):
        ends[side] = np.stack([place[:, 0], np.full(n, half - 2.0 * half * side), place[:, 1]], 1)
    return ends


def markers(simulation: AnySimulation, frame: str) -> MarkerArray:
    """Return steps, links and carriage at the simulation's present state.

    Parameters
    ----------
    simulation : Simulation or MultibodySimulation
        In its present state.
    frame : str
        x towards the upper landing, y to the left, z up, origin as in the machine's data sheet.
    """
    machine = simulation.machine
    ends = axle_ends(simulation)
    ahead = np.roll(ends, -1, axis=1)
    (left, right), (left_ahead, right_ahead) = ends, ahead
    links = _marker(frame, 0, 'links', Marker.LINE_LIST, LINK_COLOUR, LINE_M)
    links.points = _points(np.stack([ends, ahead], axis=2).reshape(-1, 3))
    steps = _marker(frame, 1, 'steps', Marker.TRIANGLE_LIST, STEP_COLOUR, 1.0)
    corners = [left, right, right_ahead, left, right_ahead, left_ahead]
    steps.points = _points(np.stack(corners, axis=1).reshape(-1, 3))
    carriage = _marker(frame, 2, 'carriage', Marker.CUBE, CARRIAGE_COLOUR, 0.2)
    guide = machine.guide
    carriage.scale.y = 0.8 * machine.chain.track_gauge_m
    outward = carriage_way(simulation)
    free = isinstance(simulation, MultibodySimulation)
    # free bodies count from the lower gear's centre, a chain from where its landing ends
    carriage.pose.position.x = -outward if free else -guide.lower_landing_m - outward
    carriage.pose.position.z = 0.0 if free else -guide.turnaround_radius_m
    return MarkerArray(markers=[links, steps, carriage])


def carriage_way(simulation: AnySimulation) -> float:
    """Return the displacement of the lower turnaround, m."""
    if isinstance(simulation, MultibodySimulation):
        return float(simulation.data.qpos[3 * len(simulation.network.mass)])
    return float(simulation.data.qpos[0])


def _marker(
    frame: str, number: int, name: str, kind: int, colour: ColorRGBA, size: float
) -> Marker:
    marker = Marker(ns=name, id=number, type=kind, action=Marker.ADD, color=colour)
    marker.header.frame_id = frame
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = size
    return marker


def _points(rows: Floats) -> Sequence[Point]:
    return [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in rows]
