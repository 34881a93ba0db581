"""What the recordings tell of the instruments and of the lateral line."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from rig.comparison import ACCELERATIONS, channels_of
from rig.draw import build, lay_rails, Tolerances
from rig.guide import read_survey
from rig.instruments import BENDING, LINKS, ONBOARD_HZ
from rig.machine import SURVEY
from rig.measured import Measured, read_measured
from rig.model import RECORD
from rig.sheet import Sheet
from rig.travel import fit_travel, Loop, low_pass, mean_speed, steady_loop

FloatArray = NDArray[np.float64]

LATERAL_HZ = 15.0  # Hz, below which the lateral line is looked for
LOOP_M = 24.4057  # m, data sheet
CELLS = 2441  # of the loop, 1 cm each
SEEN = 4e-6  # m, waves whose standard error is below this are shown
GROUP = 16  # waves per line
RECORDINGS = (
    'clean_1',
    'clean_2',
    'drive_ripple',
    'gauge_gain',
    'load_distribution',
    'roller_drag',
    'tensioner_friction',
)


def gauge_rows(path: Path) -> tuple[dict[str, FloatArray], FloatArray, FloatArray]:
    """Return the gauges per link (n, 4), and latency samples of the ground logger (s)."""
    rows: dict[str, list] = {link: [] for link in LINKS}
    late, steps = [], []
    with AnyReader([path]) as reader:
        for connection, bag_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            if connection.topic.endswith('strain'):
                rows[message.link].append(message.strain)
            elif connection.topic.endswith('displacement'):
                late.append((bag_ns - stamp.sec * 10**9 - stamp.nanosec) * 1e-9)
            elif connection.topic.endswith('acceleration'):
                steps.append(message.linear_acceleration.y)
    return {k: np.array(v) for k, v in rows.items()}, np.array(late), np.array(steps)


def show_instruments(seeded: Path) -> None:
    """Print latency, resolution, gauge pairs and bending of clean_2."""
    rows, late, steps = gauge_rows(seeded / 'clean_2')
    skew = np.mean((late - late.mean()) ** 3) / late.std() ** 3
    print(
        f'latency: least {late.min() * 1e3:.2f} ms, mean {late.mean() * 1e3:.2f}, '
        f'sigma {late.std() * 1e3:.2f}, skewness {skew:.2f}'
    )
    jumps = np.abs(np.diff(steps))
    print(f'accelerometer: smallest step {jumps[jumps > 1e-6].min():.4f} m/s2')
    for link, gauges in rows.items():
        slow = low_pass(gauges.T, ONBOARD_HZ)[:, 400:-400]
        drift = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, slow.shape[1]), 4)
        bent = (slow[0] + slow[2] - slow[1] - slow[3]) / 2.0
        parts = np.column_stack([slow.mean(axis=0), bent, drift])
        found = [
            np.linalg.lstsq(parts, slow[a] - slow[b], rcond=None)[0][:2]
            for a, b in ((0, 2), (1, 3))
        ]
        told = ', '.join(f'{axial:.3f} and {edge:.3f}' for axial, edge in found)
        print(
            f'gauges of {link}, 1 less 3 and 2 less 4, of the axial strain and of the bending: {told}'
        )


def travelled(path: Path) -> tuple[Measured, Loop, FloatArray, float]:
    """Return a recording, the nominal loop, the rack at its on-board samples and the speed."""
    measured = read_measured(path)
    speed = mean_speed(measured, Sheet().pitch_m)
    loop = steady_loop(lay_rails(build(Sheet(), measured.case, speed, Tolerances()), None))
    travel = fit_travel(measured, loop, speed)
    return measured, loop, travel.at(measured.onboard_s), speed


def show_bending(measured: Measured, loop: Loop, rack: FloatArray, gauges: FloatArray) -> None:
    """Print the bending of link 0, left, by the sum of its axle ends' normal forces."""
    upper_less_lower = 0.25 * (gauges[:, 0] + gauges[:, 2] - gauges[:, 1] - gauges[:, 3])
    bend = low_pass(upper_less_lower, ONBOARD_HZ)[400:-400]
    load = low_pass(loop.at('n_left_0', rack) + loop.at('n_left_1', rack), ONBOARD_HZ)[400:-400]
    slow = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, bend.size), 4)
    design = np.column_stack([load, slow])
    found = np.linalg.lstsq(design, bend, rcond=None)[0]
    left = (bend - design @ found).std()
    print(
        f'bending of left_a in {measured.name}: {found[0]:.2e} 1/N (used {BENDING:.1e}), '
        f'{left * 1e6:.3f} of {bend.std() * 1e6:.2f} microstrain rms left'
    )


def lateral_waves(
    measured: Measured, loop: Loop, rack: FloatArray, speed: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the loop's waves of lateral acceleration, their transfer and its weight.

    The step's middle moves as the mean of axles 0 and 1, each a damped mass on the line.
    """
    x, y, z = (
        low_pass(channels_of(measured)[name], ONBOARD_HZ, LATERAL_HZ) for name in ACCELERATIONS
    )
    others = np.column_stack([x, z, np.ones_like(x)])
    y = y - others @ np.linalg.lstsq(others, y, rcond=None)[0]
    turn = 2.0 * np.pi / LOOP_M
    angle = [wave(turn * loop.rows[:, RECORD.index('s_left')]) for wave in (np.cos, np.sin)]
    inside = loop.rack[0] + (rack - loop.rack[0]) % loop.length_m
    cosine, sine = (np.interp(inside, loop.rack, part) for part in angle)
    s = np.arctan2(sine, cosine) % (2.0 * np.pi) / turn
    cell = np.floor(s / LOOP_M * CELLS).astype(int) % CELLS
    count = np.maximum(np.bincount(cell, minlength=CELLS), 1)
    waves = np.fft.fft(np.bincount(cell, y, CELLS) / count) / CELLS
    k = np.fft.fftfreq(CELLS, 1.0 / CELLS)
    sheet = Sheet()
    omega = turn * k * speed * measured.case.direction
    line = sheet.lateral_stiffness_n_m + 1j * omega * sheet.lateral_damping_ns_m
    transfer = -(omega**2) * line / (line - sheet.axle_mass_kg * omega**2)
    transfer *= 0.5 * (1.0 + np.exp(1j * turn * k * sheet.pitch_m))
    return waves, transfer, np.full(CELLS, measured.onboard_s.size / 0.02**2)


def survey_waves() -> NDArray[np.complex128]:
    """Return the lateral survey's waves round the loop, each row at its place."""
    survey = read_survey(SURVEY)
    s, lateral = survey[:, 0], survey[:, 2]
    share = ((np.roll(s, -1) - np.roll(s, 1)) % LOOP_M) / (2.0 * LOOP_M)
    k = np.arange(s.size // 2)
    return np.exp(-2j * np.pi * np.outer(k, s / LOOP_M)) @ (share * lateral)


def show_lateral(seeded: Path) -> None:
    """Print the true lateral line, found from the lateral acceleration, beside the survey."""
    half = survey_waves()
    found, lines = 0.0, {}
    weight = 0.0
    for name in RECORDINGS:
        measured, loop, rack, speed = travelled(seeded / name)
        waves, transfer, certain = lateral_waves(measured, loop, rack, speed)
        found = found + np.conj(transfer) * waves * certain
        weight = weight + np.abs(transfer) ** 2 * certain
        lines[name] = waves - transfer * np.pad(half[:196], (0, CELLS - 196))
    line = found / np.maximum(weight, 1e-30)
    error = 1.0 / np.sqrt(np.maximum(weight, 1e-30))
    print('lateral line: rms per wave (mm) of survey, of rail, of their difference')
    for first in range(48, half.size - GROUP, GROUP):
        some = [k for k in range(first, first + GROUP) if error[k] < SEEN]
        rms = [
            1e3 * np.sqrt(np.mean(np.abs(part) ** 2))
            for part in (half[some], line[some], half[some] - line[some])
        ]
        print(
            f'  {first / LOOP_M:5.2f} to {(first + GROUP) / LOOP_M:5.2f} per metre: '
            + '  '.join(f'{value:.4f}' for value in rms)
        )
    show_common(lines)


def show_common(lines: dict[str, FloatArray]) -> None:
    """Print how alike the recordings' unexplained lateral accelerations are (3 to 8 per m)."""
    low, high = int(3.0 * LOOP_M), int(8.0 * LOOP_M)
    parts = {name: waves[low:high] for name, waves in lines.items() if name != 'clean_2'}
    names = list(parts)
    alike = []
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            product = np.vdot(parts[one], parts[other])
            size = np.linalg.norm(parts[one]) * np.linalg.norm(parts[other])
            alike.append(float(product.real / size))
    print(
        f'what the survey leaves of the lateral acceleration, between {len(names)} machines: '
        f'correlation {min(alike):.2f} to {max(alike):.2f}'
    )


def show_sensors(seeded: Path) -> None:
    """Print everything that the recordings tell of instruments and lateral line."""
    show_instruments(seeded)
    measured, loop, rack, _ = travelled(seeded / 'clean_2')
    show_bending(measured, loop, rack, gauge_rows(seeded / 'clean_2')[0]['left_a'])
    show_lateral(seeded)
