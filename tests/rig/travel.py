"""Find where the rack was at each moment of a recording: speed, loop position, slow wander."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import least_squares
from scipy.signal import butter, sosfiltfilt

from rig.instruments import GROUND_HZ, LINKS, ONBOARD_HZ
from rig.measured import Measured
from rig.model import Model, RECORD
from rig.run import run

FloatArray = NDArray[np.float64]

CUT_HZ = 2.0  # Hz, of the comparison's low-pass
KNOT_S = 15.0  # s, between the wander's knots: half its shortest period
EDGE_S = 2.0  # s, left out at both ends, where the filter has not settled
SETTLE_S = 12.0  # s
WEIGHT = {'force': 1.0 / 30.0, 'u': 1.0 / 2e-5}  # 1/N, 1/m


def low_pass(values: FloatArray, rate_hz: float, cut_hz: float = CUT_HZ) -> FloatArray:
    """Return ``butter(4)`` by ``sosfiltfilt`` along the last axis."""
    return sosfiltfilt(butter(4, cut_hz, fs=rate_hz, output='sos'), values, axis=-1)


def mean_speed(measured: Measured, pitch_m: float) -> float:
    """Return the real speed (m/s): the tensioner's main frequency times the pitch."""
    x = measured.displacement - measured.displacement.mean()
    size = 2**20
    power = np.abs(np.fft.rfft(x * np.hanning(x.size), size))
    frequency = np.fft.rfftfreq(size, float(np.median(np.diff(measured.ground_s))))
    expected = measured.case.speed_m_s / pitch_m
    near = np.abs(frequency / expected - 1.0) < 0.15
    return float(frequency[near][power[near].argmax()] * pitch_m)


@dataclass(frozen=True)
class Loop:
    """The machine's steady motion over one loop of the chain, by the rack's travel."""

    rack: FloatArray  # (n,) m, increasing
    rows: FloatArray  # (n, columns of RECORD)
    length_m: float  # the chain's: after it every axle is where it was

    def at(self, name: str, rack: FloatArray) -> FloatArray:
        """Return a column of ``RECORD`` at the given rack travel."""
        inside = self.rack[0] + (rack - self.rack[0]) % self.length_m
        values = self.rows[:, RECORD.index(name)]
        return np.interp(
            inside,
            np.append(self.rack, self.rack[0] + self.length_m),
            np.append(values, values[0]),
        )


def steady_loop(model: Model) -> Loop:
    """Run one loop of a machine all whose links are alike."""
    length = model.pitch * (model.mass.size // 2)
    rows = run(model, 3.0, SETTLE_S, length / model.speed + 0.5)
    rows = rows[np.argsort(rows[:, 0])]
    keep = rows[:, 0] < rows[0, 0] + length
    return Loop(rows[keep, 0], rows[keep], length)


@dataclass(frozen=True)
class Travel:
    """The rack's travel: ``start + direction * speed * t`` and a slow spline (m)."""

    start: float
    velocity: float
    wander: BSpline
    ground_lead: float  # m, what the ground logger's time is off, as travel

    def at(self, time_s: FloatArray) -> FloatArray:
        inside = np.clip(time_s, self.wander.t[0], self.wander.t[-1])
        return self.start + self.velocity * time_s + self.wander(inside)


def coarse_start(measured: Measured, loop: Loop, velocity: float) -> float:
    """Return the rack travel at time 0 (m) at which the first link's force fits best."""
    time_s = measured.onboard_s[::20]
    force = low_pass(measured.force[0], ONBOARD_HZ)[::20]
    starts = np.arange(0.0, loop.length_m, 0.1)
    fits = [
        np.corrcoef(loop.at(f'force_{LINKS[0]}', s + velocity * time_s), force)[0, 1]
        for s in starts
    ]
    return float(starts[int(np.argmax(fits))])


def fit_travel(measured: Measured, loop: Loop, speed: float) -> Travel:
    """Fit start, wander and the ground logger's lead to forces and tensioner."""
    velocity = measured.case.direction * speed
    start = coarse_start(measured, loop, velocity)
    end = float(max(measured.onboard_s[-1], measured.ground_s[-1])) + 0.1
    inner = np.linspace(-0.1, end, max(int(end / KNOT_S), 2) + 1)
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    force = low_pass(measured.force, ONBOARD_HZ)
    displacement = low_pass(measured.displacement, GROUND_HZ)
    on = slice(int(EDGE_S * ONBOARD_HZ), -int(EDGE_S * ONBOARD_HZ), 5)
    ground = slice(int(EDGE_S * GROUND_HZ), -int(EDGE_S * GROUND_HZ), 5)

    def travel_of(p: FloatArray) -> Travel:
        return Travel(start, velocity, BSpline(knots, p[:-1], 3), float(p[-1]))

    def misfit(p: FloatArray) -> FloatArray:
        travel = travel_of(p)
        rack = travel.at(measured.onboard_s)
        parts = []
        for k, link in enumerate(LINKS):
            part = (force[k] - low_pass(loop.at(f'force_{link}', rack), ONBOARD_HZ))[on]
            parts.append((part - part.mean()) * WEIGHT['force'])
        rack = travel.at(measured.ground_s) + travel.ground_lead
        part = (displacement - low_pass(loop.at('u', rack), GROUND_HZ))[ground]
        return np.concatenate([*parts, (part - part.mean()) * WEIGHT['u']])

    guess = np.zeros(inner.size + 3)
    found = least_squares(misfit, guess, x_scale=0.01, loss='soft_l1', max_nfev=25)
    return travel_of(found.x)
