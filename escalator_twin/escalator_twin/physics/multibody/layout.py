"""Which parts of a machine run, as one network, and where each part's numbers lie in it."""

from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.errors import MachineError
from escalator_twin.machine.multibody import MultibodyMachine
from escalator_twin.physics.multibody.loop import relax
from escalator_twin.physics.multibody.network import join, make_memory, Network
from escalator_twin.physics.multibody.rail import (
    handrail_part,
    HandrailPart,
    tightened,
)
from escalator_twin.physics.multibody.segments import (
    FRICTION,
    LENGTH,
    next_at,
    RADIUS,
    ROTOR,
    START,
)
from escalator_twin.physics.multibody.steps import place_steps, step_part, StepPart
from escalator_twin.signals import Experiment, Floats

PARTS = ('steps', 'handrail')
RELAX_RATE = 20.0  # 1/s
TIGHTEN_S, TIGHTEN_ROUNDS, TIGHTEN_TO = 0.5, 12, 5e-3  # of the tension


@dataclass(frozen=True)
class Layout:
    """A network and what it is made of.

    Attributes
    ----------
    network : Network
    steps : StepPart or None
    handrail : HandrailPart or None
        Behind the steps, where both are there.
    """

    network: Network
    steps: StepPart | None
    handrail: HandrailPart | None

    @property
    def first_rail_body(self) -> int:
        """The handrail's first body."""
        return 3 * self.steps.n if self.steps else 0

    @property
    def first_rail_point(self) -> int:
        """The handrail's first contact point."""
        return 2 * self.steps.n if self.steps else 0

    @property
    def first_rail_link(self) -> int:
        """The handrail's first link."""
        return self.steps.n if self.steps else 0


def lay_out(
    machine: MultibodyMachine, experiment: Experiment, parts: tuple[str, ...] = PARTS
) -> Layout:
    """Lay out the parts asked for that a machine has, without deviations."""
    steps = step_part(machine, experiment) if 'steps' in parts else None
    rail = None
    if 'handrail' in parts and machine.handrail is not None:
        rail = fitted(machine, handrail_part(machine, machine.handrail, experiment))
    if steps and rail:
        return Layout(join(steps.network, rail.network), steps, rail)
    if not steps and not rail:
        raise MachineError(f'{machine.source}: expected steps or a handrail, found neither')
    network = steps.network if steps else rail.network if rail else None
    assert network is not None
    return Layout(network, steps, rail)


def fitted(machine: MultibodyMachine, part: HandrailPart) -> HandrailPart:
    """Return a handrail whose tensioners are set: they give it the description's tension.

    That is its mean at rest, without friction. What they take up is told by the links' free
    length.
    """
    assert machine.handrail is not None
    wanted = machine.handrail.tension_n
    compliance = part.spacing_m / machine.handrail.axial_stiffness_n
    segments = part.network.segments.copy()
    segments[:, FRICTION] = 0.0
    q = np.append(part.rest.ravel(), np.zeros(len(part.network.rotor)))
    n_steps = round(TIGHTEN_S / machine.time_step_s)
    per_newton, taken, before = compliance, 0.0, None
    for _ in range(TIGHTEN_ROUNDS):
        slippery = part.network._replace(segments=segments)
        memory = make_memory(slippery)
        relax(slippery, memory, q, np.zeros(len(q)), machine.time_step_s, n_steps, RELAX_RATE)
        mean = float(memory.tension.mean())
        if abs(mean / wanted - 1.0) < TIGHTEN_TO:
            break
        if before is not None and mean != before:
            # guides yield as well: the secant tells by how much
            per_newton = float(np.clip(taken / (mean - before), compliance, 20.0 * compliance))
        before, taken = mean, (wanted - mean) * per_newton
        part = tightened(part, taken)
    return replace(part, rest=q[: 3 * len(part.network.mass)].reshape(-1, 3))


def chain_places(part: StepPart, start_m: float) -> Floats:
    """Return path coordinates of all axles, one pitch apart from ``start_m`` on.

    What is left of the loop is shared by all links.
    """
    track, pitch = part.chain, float(part.network.link[0, 2])
    places = np.empty(part.n + 1)
    places[0] = start_m
    for i in range(part.n):
        places[i + 1] = next_at(track.rows, track.length_m, places[i], pitch)
    share = track.length_m / (places[-1] - start_m)
    return start_m + (places[:-1] - start_m) * share


def slack_m(part: StepPart) -> float:
    """Return by how much the chain is longer than its track, links straight between rollers."""
    track, pitch = part.chain, float(part.network.link[0, 2])
    s = 0.0
    for _ in range(part.n):
        s = next_at(track.rows, track.length_m, s, pitch)
    return s - track.length_m


def pose(layout: Layout, machine: MultibodyMachine, start_m: float) -> tuple[Floats, Floats]:
    """Return coordinates with axle 0 at a place, and the angles of the rotors.

    The upper gear is turned so that a seat meets the axle nearest to its middle.
    """
    rows, angles = [], []
    if layout.steps is not None:
        places = chain_places(layout.steps, start_m)
        rows.append(place_steps(layout.steps, machine, places))
        track = layout.steps.chain
        gear = track.rows[track.rows[:, ROTOR] >= 0.0][0]
        ways = (places - gear[START]) % track.length_m
        nearest = ways[np.argmin(np.abs(ways - 0.5 * gear[LENGTH]))]
        angles.append(float(nearest / gear[RADIUS]))
    if layout.handrail is not None:
        rows.append(layout.handrail.rest)
        angles.append(0.0)
    n = layout.network
    q = np.concatenate([*(row.ravel() for row in rows), np.zeros(len(n.part)), angles])
    return q, np.array(angles)
