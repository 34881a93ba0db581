r"""A belt on its guides as a rope, by hand: tension over the loop, and the torque that drives it.

Along the motion, at steady speed, with weight w per metre at the height z(s), tangent t, signed
turn 1/R (positive to the left), drag per metre d(N) of the support N:

.. math:: dT/ds = w z'(s) + d(N),  \quad N = w t_x - T / R

A step's weight is not on the chain's line: z is that of all that rides with an axle at s.

In a bend of radius R, bodies a length L apart are a polygon: their links pull by 1/cos(x) harder
than the rope does, x = L / 2R, and press T L/R tan(x)/x on a body. Where a bend of short radius begins,
a body on the straight is pressed by the link ahead of it already, see `kinks`. The driven arc gives back what its two ends differ by; power is force times speed there and torque
times angular speed at the shaft. Bodies, links, contacts, rollers' spin and impacts are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, sqrt, tan

import numpy as np

from escalator_twin.machine import MultibodyMachine
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.guide import (
    chain_track,
    handrail_track,
    SIDES,
    STEP_SEGMENTS,
    Track,
)
from escalator_twin.physics.multibody.layout import slack_m
from escalator_twin.physics.multibody.rail import POINT_SHARE
from escalator_twin.physics.multibody.segments import next_at, place_on
from escalator_twin.physics.multibody.steps import place_steps, step_part, StepPart
from escalator_twin.signals import Experiment, Floats

STEP_M = 2e-3
HEIGHT_M = 1e-2  # grid of heights
KINK_M = 1e-2  # grid of links' angles
ROUNDS = 60

# of place, tension, t_x, turn, segment
Drag = Callable[[float, float, float, float, int], float]
Rise = Callable[[float], float]  # of path coordinate: weight times slope, N/m


def polygon(bend: float, length_m: float) -> float:
    """Return by how much more links of a length press into a bend than a rope does."""
    x = 0.5 * length_m * abs(bend)
    return tan(x) / x if x > 0.0 else 1.0


def kinks(track: Track, length_m: float) -> Callable[[float], float]:
    """Return, for path coordinates, how links press to the left per tension and length, 1/m.

    A body between two straight links, each of which pulls along the path by the tension: with unit
    vectors e to the bodies ahead and behind, tangent t and left normal n it is the sum of
    (n e) / |t e|, over the length of a link.
    """
    s = np.linspace(0.0, track.length_m, round(track.length_m / KINK_M), endpoint=False)
    rows, length = track.rows, track.length_m
    ahead = np.array([next_at(rows, length, x, length_m) for x in s])
    order = np.argsort(ahead % length)
    behind = np.interp(s, (ahead % length)[order], (s - ahead)[order], period=length) + s
    total = np.zeros(len(s))
    for ends in (ahead, behind):
        for i, (x, y) in enumerate(zip(s, ends, strict=True)):
            px, pz, tx, tz = place_on(rows, length, x)
            qx, qz, _, _ = place_on(rows, length, y % length)
            along = (qx - px) * tx + (qz - pz) * tz
            total[i] += ((qz - pz) * tx - (qx - px) * tz) / abs(along)
    return lambda where: float(np.interp(where, s, total / length_m, period=length))


@dataclass(frozen=True)
class Rope:
    """A belt in steady motion.

    Attributes
    ----------
    s_m, tension_n : (n,) float64
        Path coordinate, tension; NaN on the driven arc.
    drive_n : float
        Force along the path that the driven arc gives.
    torque_n_m : float
        At its shaft.
    """

    s_m: Floats
    tension_n: Floats
    drive_n: float
    torque_n_m: float

    def at(self, s_m: Floats) -> Floats:
        """Return the tension at path coordinates inside the loop."""
        return np.interp(s_m, self.s_m, self.tension_n)


def march(
    track: Track, driven: int, rise: Rise, slack_n: float, drag: Drag, idle: Drag
) -> tuple[Floats, Floats, float]:
    """Return way, tension from the driven arc's end round to its start, and the arc's force.

    ``idle`` is the drag of what is not at rest on the driven arc.
    """
    row = track.rows[driven]
    begin, end = float(row[seg.START]), float(row[seg.START] + row[seg.LENGTH])
    n = round((track.length_m - row[seg.LENGTH]) / STEP_M)
    h = (track.length_m - row[seg.LENGTH]) / n
    s = end + h * np.arange(n + 1)
    tension = np.empty(n + 1)
    tension[0] = slack_n
    starts = track.rows[:, seg.START]

    def rate(where: float, pull: float, law: Drag) -> float:
        here = where % track.length_m
        k = int(np.searchsorted(starts, here, side='right')) - 1
        _, _, tx, _ = place_on(track.rows, track.length_m, here)
        bend = 0.0
        if track.rows[k, seg.TURN] != 0.0:
            bend = track.rows[k, seg.TURN] / track.rows[k, seg.RADIUS]
        return rise(here) + law(here, pull, tx, bend, k)

    for i in range(n):
        half = tension[i] + 0.5 * h * rate(s[i] + 1e-9, tension[i], drag)
        tension[i + 1] = tension[i] + h * rate(s[i] + 0.5 * h, half, drag)
    rest = 0.0
    for part in (np.arange(200) + 0.5) / 200.0:
        rest += rate(begin + part * row[seg.LENGTH], 0.0, idle) * row[seg.LENGTH] / 200.0
    return s, tension, float(tension[-1] - tension[0] + rest)


def _closed(track: Track, s: Floats, tension: Floats) -> tuple[Floats, Floats]:
    """Return way within one loop, increasing, and tension."""
    inside = s % track.length_m
    order = np.argsort(inside)
    return inside[order], tension[order]


def step_rope(machine: MultibodyMachine, experiment: Experiment) -> Rope:
    """Return the chain of the steps, going up, its level from the lower gear's spring."""
    part = step_part(machine, experiment)
    track, pitch, g = part.chain, machine.chain.pitch_m, machine.gravity_m_s2
    roller, step, speed = machine.roller, machine.step, experiment.set_speed_m_s
    behind = step.centre_behind_m / step.wheelbase_m
    trailing = SIDES * roller.mass_kg + roller.trailing_extra_kg + behind * step.mass_kg
    on_chain = machine.chain.mass_per_pitch_kg + (1.0 - behind) * step.mass_kg
    chain_w, trailing_w = on_chain * g / pitch, trailing * g / pitch
    fixed = SIDES * (roller.seal_drag_n + roller.viscous_drag_n_s_m * speed) / pitch
    fades = roller.friction_rise * np.exp(-speed / roller.friction_speed_m_s)
    resistance = roller.rolling_resistance * (1.0 + fades)
    driven = STEP_SEGMENTS.index('upper gear')
    kink = kinks(track, pitch)

    def idle(_s: float, _t: float, tx: float, _b: float, _k: int) -> float:
        return resistance * trailing_w * abs(tx) + fixed

    def drag(s: float, pull: float, tx: float, bend: float, k: int) -> float:
        support = abs(chain_w * tx - kink(s) * pull)
        return resistance * support + fixed + idle(s, pull, tx, bend, k)

    rise = _step_rise(machine, part)
    slack, spring = 0.5 * float(experiment.preload_n), machine.tensioner
    empty_m, lower = slack_m(part), STEP_SEGMENTS.index('lower gear')
    way = float(track.rows[lower, seg.START])
    for _ in range(ROUNDS):
        s, tension, force = march(track, driven, rise, slack, drag, idle)
        outward = 0.5 * (empty_m + _longer(machine, track, s, tension, chain_w))
        strands = tension[np.searchsorted(s, [way, track.length_m])].sum()
        wanted = float(experiment.preload_n) - spring.stiffness_n_m * outward
        slack += 0.5 * (wanted - strands)
        if abs(wanted - strands) < 1e-3:
            break
    torque = force * machine.drive.seats * pitch / (2.0 * pi)
    return Rope(*_closed(track, s, tension), force, torque)


def _step_rise(machine: MultibodyMachine, part: StepPart) -> Rise:
    """Return the weight per metre of a step, its rollers and its chain, times its slope."""
    track, n, mass = part.chain, part.n, part.network.mass
    s = np.linspace(0.0, track.length_m, round(track.length_m / HEIGHT_M))
    one = np.array([mass[0], mass[n], mass[2 * n]])
    single = replace(part, n=1)
    height = np.array([one @ place_steps(single, machine, np.array([x]))[:, 1] for x in s])
    slope = np.gradient(height, s) * machine.gravity_m_s2 / machine.chain.pitch_m
    return lambda where: float(np.interp(where, s, slope))


def _longer(
    machine: MultibodyMachine, track: Track, s: Floats, tension: Floats, weight: float
) -> float:
    """Return by how much the loop must open: chain stretched, rollers pressed into bends, m."""
    pitch, play = machine.chain.pitch_m, machine.guide.channel_clearance_m
    stretch = float(np.mean(tension)) * track.length_m / pitch
    stretch /= SIDES * machine.chain.link_stiffness_n_m
    total = stretch
    for row in track.rows:
        if row[seg.TURN] == 0.0 or row[seg.HALF] == 0.0:
            continue
        middle = row[seg.START] + 0.5 * row[seg.LENGTH]
        pull = float(np.interp(middle, *_closed(track, s, tension)))
        _, _, tx, _ = place_on(track.rows, track.length_m, middle)
        support = (weight * tx - row[seg.TURN] / row[seg.RADIUS] * pull) * pitch
        stiffness = row[seg.STIFF_LOW] if support > 0.0 else row[seg.STIFF_HIGH]
        depth = (abs(support) / stiffness) ** (2.0 / 3.0)
        face = 0.5 * (row[seg.LOW] + row[seg.LOW_END])
        offset = face - depth if support > 0.0 else face + play + depth
        # inwards is where the turn goes to
        total += row[seg.TURN] * offset * 2.0 * row[seg.HALF]
    return total


def handrail_rope(machine: MultibodyMachine, mean_n: float) -> Rope:
    """Return the handrail, going up, its level from the mean tension over the loop."""
    handrail = machine.handrail
    assert handrail is not None
    track = handrail_track(machine, handrail)
    weight = handrail.mass_per_m_kg * machine.gravity_m_s2

    def rise(where: float) -> float:
        return weight * place_on(track.rows, track.length_m, where)[3]

    driven = int(np.flatnonzero(track.rows[:, seg.ROTOR] >= 0.0)[0])
    friction = track.rows[:, seg.FRICTION]

    spacing = track.length_m / handrail.n_bodies

    def idle(_s: float, _p: float, _x: float, bend: float, k: int) -> float:
        # a bend costs the moment of its angle, in and out. Stiffness takes from one of a body's
        # points what it gives to the other, as long as tension presses both
        return 2.0 * handrail.bending_drag_n_m * abs(bend) / float(track.rows[k, seg.LENGTH])

    def drag(s: float, pull: float, tx: float, bend: float, k: int) -> float:
        support = abs(weight * tx - bend * pull * polygon(bend, spacing))
        return friction[k] * support + idle(s, pull, tx, bend, k)

    slack = mean_n
    for _ in range(ROUNDS):
        s, tension, force = march(track, driven, rise, slack, drag, idle)
        mean = float(np.mean(tension))
        slack += mean_n - mean
        if abs(mean - mean_n) < 1e-3:
            break
    turning = 2.0 * np.arcsin(
        spacing / (2.0 * sqrt(handrail.pulley_radius_m**2 - (POINT_SHARE * spacing) ** 2))
    )
    return Rope(*_closed(track, s, tension), force, float(force * spacing / turning))


def straight_places(machine: MultibodyMachine) -> list[tuple[str, float, float]]:
    """Return name and ends of the chain's straight segments that are longer than four pitches.

    One pitch at either end is left out: links there lie across a joint.
    """
    track, pitch = chain_track(machine), machine.chain.pitch_m
    return [
        (name, float(row[seg.START]) + pitch, float(row[seg.START] + row[seg.LENGTH]) - pitch)
        for name, row in zip(track.names, track.rows, strict=True)
        if row[seg.TURN] == 0.0 and row[seg.LENGTH] > 4.0 * pitch
    ]
