"""Machines and runs for the verification: ideal guides, stiff limits, bare records."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.physics.parameters import make_parameters, Parameters
from escalator_twin.physics.path import build_path
from escalator_twin.physics.rollout import Simulation
from escalator_twin.signals import Experiment, Floats

STEP_S = 1e-3


def ideal(machine: Machine) -> Machine:
    """Return a machine whose rollers run exactly on the designed path."""
    guide = replace(machine.guide, channel_clearance_m=0.0, survey_file=None)
    return replace(machine, guide=guide, deviations=())


def case(
    speed_m_s: float, direction: int = 1, load_kg: float = 0.0, preload_n: float = 3000.0
) -> Experiment:
    """Return an experiment."""
    return Experiment(speed_m_s, direction, (load_kg,), preload_n)


def stiffened(p: Parameters, factor: float) -> Parameters:
    """Return parameters with links and guide stiffer by a factor."""
    return p._replace(
        link_stiffness=p.link_stiffness * factor, contact_stiffness=p.contact_stiffness * factor
    )


@dataclass(frozen=True)
class Trial:
    """A simulation that can be read by probes.

    Attributes
    ----------
    simulation : Simulation
    """

    simulation: Simulation

    def record(self, duration_s: float, rate_hz: float, *probes: tuple[int, int, int]) -> Floats:
        """Return what probes of ``physics.run`` read, one column each; places unwrapped."""
        table = self.simulation.advance(duration_s, rate_hz, np.array(probes, dtype=np.int64))
        for column, probe in enumerate(probes):
            if probe[0] == run.PLACE:
                length = self.simulation.path.length_m
                table[:, column] = np.unwrap(table[:, column], period=length)
        return table


def start(
    machine: Machine,
    experiment: Experiment,
    start_s_m: float,
    *,
    planar: bool = True,
    step_s: float = STEP_S,
    factor: float = 1.0,
    **changes: Any,
) -> Trial:
    """Start a machine whose links and guide are ``factor`` times stiffer.

    Parameters
    ----------
    machine : Machine
        Without its deviations.
    experiment : Experiment
        Its speed is the rack's.
    start_s_m : float
        Path coordinate of axle 0, m.
    planar : bool
        Both sides in one.
    step_s : float
        Time step, s.
    factor : float
        1 for the machine as it is.
    **changes : float or array
        Other parameters of the force law.
    """
    p = stiffened(make_parameters(machine, experiment, planar), factor)._replace(**changes)
    simulation = Simulation(machine, p, build_path(machine.guide), step_s)
    simulation.start(start_s_m)
    return Trial(simulation)
