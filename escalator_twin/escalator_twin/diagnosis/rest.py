"""Where a carriage rests, which a sensor whose zero is arbitrary does not say."""

import numpy as np

from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.knobs import knobs_of


def with_rest(context: Context, sd: dict[str, float]) -> dict[str, float]:
    """Return spreads with what the carriage's place at rest adds to a stop's.

    The sensor's zero is arbitrary: the data tell where in the motion the stop is, and tolerances of
    length where the motion is.
    """
    if 'displacement_m' not in sd:
        return sd
    machine, nominal = context.machine, context.nominal
    responses = context.responses if nominal is None else nominal.responses
    moved = [s.quantity == 'carriage_displacement' for s in machine.instruments.sensors]
    knobs = [knob.name for knob in knobs_of(machine, context.setting.experiment)]
    rest = [responses.knobs[name][:, moved].mean() for name in knobs if name in responses.knobs]
    return {**sd, 'displacement_m': float(np.hypot(sd['displacement_m'], np.linalg.norm(rest)))}
