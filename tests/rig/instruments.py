"""The instruments: what two loggers and a recorder make of the machine's true signals.

Sources: the data sheet's table of instruments; what it leaves open was read from the
recordings of the virtual reference rig (``docs/generator.md``): the latency's distribution,
the bending of a link under its rollers' normal forces, the drift of every gauge by itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from rig.bagfile import NS
from rig.model import RECORD
from rig.run import ROW_S
from rig.sheet import Sheet

FloatArray = NDArray[np.float64]

LINKS = ('left_a', 'left_b', 'right_a', 'right_b')
ONBOARD_HZ, GROUND_HZ = 200.0, 100.0
EPOCH_NS = 1_800_000_000 * NS  # ns, an arbitrary date of all recordings
STRAIN_NOISE, STRAIN_STEP = 0.25e-6, 0.05e-6  # m/m
ZERO_STRAIN, DRIFT_STRAIN = 100e-6, 2e-6  # m/m, the largest
GAUGE_GAIN = 0.003  # -, one standard deviation
# -, one standard deviation of twelve links of other makers: by that share of the axial strain gauges 1, 2 read more or
# less, 3, 4 the other way. Of the bending up and down they do not, to 0.3 %: a link is crooked, no gauge is.
FACE_SHARE = 0.034
BENDING = 3.0e-9  # 1/N, seen: upper edge's strain over the sum of both ends' normal forces
ACCELERATION_NOISE, ACCELERATION_STEP = 0.02, 0.0098  # m/s2; the step is seen, 0.001 g
BIAS = 0.1  # m/s2, the largest
MISALIGNMENT_DEG = 0.3  # deg, one standard deviation about each axis
REFLEX_NOISE, REFLEX_STEP, REFLEX_ZERO = 2e-5, 1e-5, 5e-3  # m
LATENCY_S, JITTER_S = 4e-3, 1e-3  # s, seen: latency + |N(0, jitter)|
TRACK_GAUGE_M = 1.0  # m, data sheet, left chain to right chain
ALIAS_HZ = 80.0  # Hz, seen: half the amplitude is left, no phase
PACKET_NS = 1000  # ns, between the rows of one on-board packet, as seen


@dataclass(frozen=True)
class Instruments:
    """One recording's imperfections."""

    clock_offset_s: float
    clock_drift: float
    recorder_offset_s: float
    recorder_drift: float
    gauge_gain: FloatArray  # (4 links, 4 gauges)
    face_share: FloatArray  # (4, 4) of the axial strain, beside it
    gauge_zero: FloatArray  # (4, 4) m/m
    gauge_drift: FloatArray  # (4, 4, 3) m/m, see drift_of
    bias_m_s2: FloatArray  # (3,)
    rotation_deg: FloatArray  # (3,) right-hand, of the sensor in the step frame
    reflex_zero_m: float


def draw_instruments(rng: np.random.Generator) -> Instruments:
    """Draw one recording's imperfections."""
    share = rng.normal(0.0, FACE_SHARE, (4, 1)) * np.array([1.0, 1.0, -1.0, -1.0])
    return Instruments(
        clock_offset_s=rng.uniform(-2.0, 2.0),
        clock_drift=rng.uniform(-50e-6, 50e-6),
        recorder_offset_s=rng.uniform(-0.02, 0.02),
        recorder_drift=rng.uniform(-2e-6, 2e-6),
        gauge_gain=1.0 + rng.normal(0.0, GAUGE_GAIN, (4, 4)),
        face_share=share,
        gauge_zero=rng.uniform(-ZERO_STRAIN, ZERO_STRAIN, (4, 4)),
        gauge_drift=rng.uniform(-1.0, 1.0, (4, 4, 3)) * DRIFT_STRAIN * [0.5, 0.25, 0.25],
        bias_m_s2=rng.uniform(-BIAS, BIAS, 3),
        rotation_deg=rng.normal(0.0, MISALIGNMENT_DEG, 3),
        reflex_zero_m=rng.normal(0.0, REFLEX_ZERO),
    )


def drift_of(coefficients: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return a gauge's thermal drift: a trend and one slow wave, at most 2 microstrain."""
    part = time_s / max(time_s[-1], 1.0)
    trend, cosine, sine = coefficients
    wave = cosine * np.cos(2.0 * np.pi * part) + sine * np.sin(2.0 * np.pi * part)
    return trend * (2.0 * part - 1.0) + wave


def anti_alias(values: FloatArray) -> FloatArray:
    """Return the signals (n, ...), one row per ``ROW_S``, as the on-board logger filters them."""
    return sosfiltfilt(butter(4, ALIAS_HZ, fs=1.0 / ROW_S, output='sos'), values, axis=0)


def link_strains(rows: FloatArray, sheet: Sheet) -> FloatArray:
    """Return ideal strains: (4 links, n, 4 gauges); 1 and 3 upper edge, 2 and 4 lower.

    ``rows`` are ``ROW_S`` apart; the logger's filter is in the result.
    """
    column = {name: k for k, name in enumerate(RECORD)}
    strains = np.empty((4, rows.shape[0], 4))
    for k, link in enumerate(LINKS):
        side, first = link[:-2], {'a': 0, 'b': 30}[link[-1]]
        axial = anti_alias(rows[:, column[f'force_{link}']]) / sheet.section_stiffness_n
        normal = rows[:, column[f'n_{side}_{first}']] + rows[:, column[f'n_{side}_{first + 1}']]
        bend = BENDING * anti_alias(normal)
        strains[k] = axial[:, None] + bend[:, None] * np.array([1.0, -1.0, 1.0, -1.0])
    return strains


def specific_force(rows: FloatArray, sheet: Sheet) -> FloatArray:
    """Return the specific force at the middle of step 0 in the step frame: (n, 3) m/s2.

    ``rows`` are ``ROW_S`` apart; the logger's filter is in the result.
    """
    column = {name: k for k, name in enumerate(RECORD)}
    ax, ay, az = (rows[:, column[name]] for name in ('ax', 'ay', 'az'))
    up = az + sheet.gravity_m_s2
    cosine, sine = np.cos(rows[:, column['angle']]), np.sin(rows[:, column['angle']])
    tilt = rows[:, column['roll']] / TRACK_GAUGE_M
    z = -ax * sine + up * cosine
    return anti_alias(np.stack([ax * cosine + up * sine, ay + tilt * z, z], axis=1))


def quantise(values: FloatArray, step: float) -> FloatArray:
    """Round to the instrument's resolution."""
    return np.round(values / step) * step


def sample_strains(
    ideal: FloatArray, time_s: FloatArray, kit: Instruments, rng: np.random.Generator
) -> FloatArray:
    """Return the strains as the gauges see them, before resolution: (4, n, 4)."""
    axial = ideal.mean(axis=2, keepdims=True)  # in the mean of all four the bending cancels
    strains = (ideal + kit.face_share[:, None, :] * axial) * kit.gauge_gain[:, None, :]
    for k in range(4):
        for g in range(4):
            strains[k, :, g] += kit.gauge_zero[k, g] + drift_of(kit.gauge_drift[k, g], time_s)
    return strains + rng.normal(0.0, STRAIN_NOISE, strains.shape)


def sample_acceleration(
    ideal: FloatArray, kit: Instruments, rng: np.random.Generator
) -> FloatArray:
    """Return the specific force in the sensor's axes, before resolution: (n, 3)."""
    turn = Rotation.from_rotvec(kit.rotation_deg, degrees=True)
    seen = turn.inv().apply(ideal) + kit.bias_m_s2
    return seen + rng.normal(0.0, ACCELERATION_NOISE, seen.shape)


def stamps(time_s: FloatArray, offset_s: float, drift: float) -> NDArray[np.int64]:
    """Return a clock's reading (ns) at the given true times."""
    return EPOCH_NS + np.round((time_s * (1.0 + drift) + offset_s) * NS).astype(np.int64)


def bag_times(time_s: FloatArray, kit: Instruments, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the recorder's times (ns) of packets that were taken at the given true times."""
    late = LATENCY_S + np.abs(rng.normal(0.0, JITTER_S, time_s.size))
    return stamps(time_s + late, kit.recorder_offset_s, kit.recorder_drift)
