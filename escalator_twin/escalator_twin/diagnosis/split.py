"""What remains of a recording, split by what it is locked to."""

import numpy as np

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.view import NO_PROBES, View
from escalator_twin.diagnosis.whitening import frequencies, in_travel
from escalator_twin.signals import Floats

LINE_ORDERS = 0.03  # cycles per pitch that belong to a multiple of the pitch, on each side
TWICE = 0.25  # of a loop that must have come twice


def in_time(place: Beside) -> Floats:
    """Return the whitened residual along the grid, nuisance taken out, (n, c)."""
    observation = place.stage.observation
    left = place.fitted.left().reshape(-1, len(observation.channels))
    return in_travel(left, len(observation.index))


def comb_shares(place: Beside) -> Floats:
    """Return the share of every channel's energy at multiples of the pitch, (c,)."""
    observation = place.stage.observation
    frame = observation.frame
    left = place.fitted.left().astype(np.float64).reshape(-1, len(observation.channels))
    f = frequencies(len(observation.index), frame.rate_hz)[: len(left)]
    orders = f * frame.pitch_m / frame.speed_m_s
    near = (np.abs(orders - np.round(orders)) < LINE_ORDERS) & (orders > 0.5)
    power = left**2
    return np.asarray(power[near].sum(axis=0) / np.maximum(power.sum(axis=0), 1e-30))


def loop_correlation(signal: Floats, n_loop: int) -> float | None:
    """Return the correlation of two passages; None where fewer than a quarter loop came twice."""
    twice = len(signal) - n_loop
    if twice < TWICE * n_loop:
        return None
    return float(np.corrcoef(signal[:twice], signal[n_loop:])[0, 1])


def split(context: Context, place: Beside) -> dict[str, dict[str, float | None]]:
    """Split a residual by channel and by what it is locked to.

    Returns
    -------
    rows : dict of channel to dict
        ``chi2``: whitened energy per coefficient, 1 on the floor. ``pitch_multiples``: its share at
        multiples of the pitch, locked to travel. ``next_loop``: correlation with the next
        passage of the same places, locked to guide or link. ``other_side``: correlation with the same
        link of the other side. ``loaded_run``: its share while the part is between the stations
        that carry the load.
    """
    observation = place.stage.observation
    machine = place.stage.machine
    time = in_time(place)
    combs = comb_shares(place)
    # a place needs no probes
    view = View(observation, context.responses, context.setting.experiment.direction, NO_PROBES)
    left = place.fitted.left().astype(np.float64).reshape(-1, len(observation.channels))
    chi2 = place.stage.whiten.temperature * np.mean(left**2, axis=0)
    rows: dict[str, dict[str, float | None]] = {}
    for k, channel in enumerate(observation.channels):
        sensor = machine.instruments.sensor(channel)
        index = sensor.at.get('link', sensor.at.get('step', 0))
        at = view.place_of(index if isinstance(index, int) else 0)
        loaded = (at >= machine.load.from_m) & (at <= machine.load.to_m)
        energy = time[:, k] ** 2
        rows[channel] = {
            'chi2': float(chi2[k]),
            'pitch_multiples': float(combs[k]),
            'next_loop': loop_correlation(time[:, k], observation.frame.n_loop),
            'other_side': _other_side(place, time, k),
            'loaded_run': float(energy[loaded].sum() / max(float(energy.sum()), 1e-30)),
        }
    return rows


def _other_side(place: Beside, time: Floats, k: int) -> float | None:
    """Return the correlation with the like sensor of the other side; None without one."""
    channels = place.stage.observation.channels
    instruments = place.stage.machine.instruments
    own = instruments.sensor(channels[k])
    if 'side' not in own.at:
        return None
    wanted = {**own.at, 'side': 'right' if own.at['side'] == 'left' else 'left'}
    for j, channel in enumerate(channels):
        other = instruments.sensor(channel)
        if other.quantity == own.quantity and dict(other.at) == wanted:
            return float(np.corrcoef(time[:, k], time[:, j])[0, 1])
    return None
