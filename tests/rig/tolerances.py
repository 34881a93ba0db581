"""What the data sheet's tolerances explain of a recording's residual.

One linear fit per recording: every tolerance by its own run one standard deviation off, a
slow correction of the rack's travel, and per channel what its instrument may do (a smooth
drift, the gauges' gain).  Each tolerance carries its spread as prior.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.comparison import Channels, FORCES, in_band, inside, NOISE, TENSIONER
from rig.draw import build, lay_rails, SPREAD, Tolerances
from rig.instruments import LINKS
from rig.measured import Measured
from rig.sheet import Sheet
from rig.travel import Loop, steady_loop, Travel

FloatArray = NDArray[np.float64]

FITTED = (*FORCES, TENSIONER)
CUT_HZ = 2.0  # Hz
STEP_M = 2e-3  # m, of the difference quotient along travel
DRIFT_ORDER = 4  # -, of the polynomials in time: drift of gauges, correction of travel
PRIOR_WEIGHT = 30.0  # -, rows of data that one standard deviation of a tolerance counts for
THINNING = 8  # -, samples per row of the fit


@dataclass(frozen=True)
class Explained:
    """Tolerances found (standard deviations) and residual rms per channel after the fit."""

    found: dict[str, float]
    residual: dict[str, float]


def one_off(name: str) -> Tolerances:
    """Return the machine with one tolerance one standard deviation up."""
    return Tolerances(**{name: SPREAD[name] + (0.0 if name.endswith('_m') else 1.0)})


def said_along(
    loop: Loop, travel: Travel, measured: Measured, cut_hz: float, ahead_m: float = 0.0
) -> Channels:
    """Return the fitted channels of a steady loop along the travel, low-passed."""
    rack = travel.at(measured.onboard_s) + ahead_m
    channels = {f: loop.at(f'force_{link}', rack) for f, link in zip(FORCES, LINKS, strict=True)}
    rack = travel.at(measured.ground_s) + travel.ground_lead + ahead_m
    channels[TENSIONER] = loop.at('u', rack)
    return in_band(channels, cut_hz)


def polynomials(channel: str, measured: Measured) -> FloatArray:
    """Return slow polynomials of time at a channel's samples: (n, order)."""
    time_s = measured.ground_s if channel == TENSIONER else measured.onboard_s
    part = 2.0 * time_s[inside(channel)] / time_s[-1] - 1.0
    return np.polynomial.chebyshev.chebvander(part, DRIFT_ORDER)


def tolerance_loops(measured: Measured, speed_m_s: float) -> list[Loop]:
    """Run the machine as designed and, one after the other, with each tolerance one off."""
    return [
        steady_loop(lay_rails(build(Sheet(), measured.case, speed_m_s, t), None))
        for t in (Tolerances(), *(one_off(name) for name in SPREAD))
    ]


def explain(
    measured: Measured,
    truth: Channels,
    said: Channels,
    loops: list[Loop],
    travel: Travel,
    cut_hz: float = CUT_HZ,
    also: dict[str, tuple[Loop, Loop]] | None = None,
) -> Explained:
    """Fit the tolerances to what is left between ``truth`` and ``said``.

    ``said`` has the labelled effects; the changes that tolerances make are those between
    ``loops``, of machines without effects.  ``also`` names further sizes, each by a machine that
    has it and one that has a step more; they are found in steps, freely.
    """
    names = list(SPREAD)
    base, *changed = [said_along(loop, travel, measured, cut_hz) for loop in loops]
    ahead = said_along(loops[0], travel, measured, cut_hz, STEP_M)
    more = [
        [said_along(loop, travel, measured, cut_hz) for loop in pair]
        for pair in (also or {}).values()
    ]
    m, p = (
        in_band({name: channels[name] for name in FITTED}, cut_hz) for channels in (truth, said)
    )
    blocks, targets = [], []
    for channel in FITTED:
        slow = polynomials(channel, measured)
        along = slow * ((ahead[channel] - base[channel]) / STEP_M)[:, None]
        shift = along[:, :1] * (channel == TENSIONER)
        own = np.column_stack([slow, p[channel]]) if channel in FORCES else slow[:, :1]
        common = np.column_stack(
            [
                *(c[channel] - base[channel] for c in changed),
                *(b[channel] - a[channel] for a, b in more),
                along,
                shift,
            ]
        )
        basis = np.linalg.qr(own)[0]
        left = m[channel] - p[channel]
        scale = 1.0 / NOISE[channel]
        blocks.append((common - basis @ (basis.T @ common)) * scale)
        targets.append((left - basis @ (basis.T @ left)) * scale)
    prior = np.zeros((len(names), blocks[0].shape[1]))
    prior[:, : len(names)] = np.eye(len(names)) * PRIOR_WEIGHT
    design = np.concatenate([*(b[::THINNING] for b in blocks), prior])
    target = np.concatenate([*(t[::THINNING] for t in targets), np.zeros(len(names))])
    found = np.linalg.lstsq(design, target, rcond=None)[0]
    residual = {
        channel: float((t - b @ found).std() * NOISE[channel])
        for channel, b, t in zip(FITTED, blocks, targets, strict=True)
    }
    told = [*names, *(also or {})]
    return Explained(dict(zip(told, found[: len(told)].tolist(), strict=True)), residual)
