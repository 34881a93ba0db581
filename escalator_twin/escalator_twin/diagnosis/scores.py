"""How what is left without and with effects compares on held-out blocks."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.whitening import sensor_variance
from escalator_twin.metrics.filters import lowpass
from escalator_twin.signals import Floats

TREND_HZ = 2.0
DRAWS = 2000  # of the block bootstrap
WORSE = 0.02  # contracts.md: no channel may become worse by more
# Of what effects do on held-out blocks: what those hold that the gain is counted over.
ACTS = 0.99
# What a wrong law changes is for better or worse by chance: fewer blocks than six are all for the better
# more often than the 2.5 % that the interval leaves below.
LEAST_BLOCKS = 6
ROUNDING = 1e-6  # of a squared residual: waves are whitened in single precision
PARTS = (1, 2, 4, 8)  # of a block, where the effects act in fewer
# Chi squared of an effect on held-out blocks: an effect that shows by less may well be there and not be
# significant. Of one that is true the fall has this mean, and twice its root for a standard deviation: at two-sided
# 5 % it is significant in 19 of 20 recordings from (2 (1.96 + 1.64))^2 on.
SHOWN = 52.0
Seen = tuple[slice, Floats, Floats]  # of a block; what is left without and with effects


@dataclass(frozen=True)
class HeldOut:
    """A held-out comparison of one recording.

    Attributes
    ----------
    split : str
        How it was split, or why it was not.
    blocks : int
        In which the effects act, or parts of them: over them the gain is counted.
    channels : mapping, or None where there is no second look
    gain_low, gain_high : float
        95 % interval, over these blocks, of the relative fall of the squared residual.
    whole_low : float
        The interval's lower end over all blocks.
    significant : bool
    worse : tuple of str
        Channels whose residual's amplitude rises by more than 2 %, both as it is, 0 to 20 Hz, and over the floor:
        the one alone may be waves of which the twin knows nothing, the other waves far below the noise. Not one
        that then holds no more than a good machine usually does: of that the twin knows nothing either.
    """

    split: str
    blocks: int
    channels: dict[str, dict[str, float]] | None
    gain_low: float = 0.0
    gain_high: float = 0.0
    whole_low: float = 0.0
    significant: bool = False
    worse: tuple[str, ...] = ()

    def document(self) -> dict[str, Any] | None:
        """Return the JSON of contracts.md; None where there is none."""
        if self.channels is None:
            return None
        return {
            'split': self.split,
            'blocks': self.blocks,
            'channels': self.channels,
            'gain_interval': [self.gain_low, self.gain_high],
            'significant': self.significant,
            'worse': list(self.worse),
        }


def scored(
    stage: Stage,
    seen: Sequence[Seen],
    split: str,
    seed: int,
    channels_used: np.ndarray,
    acted_on: np.ndarray,
    change: Floats | None = None,
    limits: Floats | None = None,
) -> HeldOut:
    """Return scores by channel and the gain over blocks, by a bootstrap of whole blocks.

    A roller that is not round acts where its axle passes a curve: most blocks of a later loop tell
    nothing of it, and a draw that happens to miss the others would tell of no gain. The gain is
    counted over the blocks in which the effects act; scores, and what becomes worse, over all.

    Parameters
    ----------
    stage : Stage
    seen : sequence of Seen
    split : str
        How the blocks were chosen, in words.
    seed : int
        Of the bootstrap.
    channels_used : (c,) bool
        Channels whose energy counts for the gain.
    acted_on : (c,) bool
        Channels that the effects change. The others differ by how the same tolerances were fitted
        alone: no claim is made on them, and they cannot become worse.
    change : (n, c) float64, optional
        What the effects do; everywhere alike where it is not given.
    limits : (c,) float64, optional
        Chi squared per coefficient that good machines' channels seldom pass: none at all where it is not given.
    """
    observation = stage.observation
    rate = observation.frame.rate_hz
    channels: dict[str, dict[str, float]] = {}
    energy = np.zeros((len(seen), 2, len(observation.channels)))
    plainly = np.zeros_like(energy)  # as `chi2_before` and `chi2_after` have it
    whitened = {
        id(rows): stage.whiten.along(_held(rows, seen))
        for _, plain, better in seen
        for rows in (plain, better)
    }
    smooth = {
        id(rows): np.stack([lowpass(rows[:, k], TREND_HZ, rate) for k in range(rows.shape[1])], 1)
        for _, plain, better in seen
        for rows in (plain, better)
    }
    for k, channel in enumerate(observation.channels):
        measured = observation.measured[:, k]
        low = lowpass(measured, TREND_HZ, rate)
        own = sensor_variance(stage.machine.instruments.sensor(channel), rate)
        rows: dict[str, list[Floats]] = {name: [] for name in ('m', 'ml', 'b', 'a', 'bl', 'al')}
        for i, (block, plain, better) in enumerate(seen):
            good = observation.valid[block, k]
            parts = (
                ('m', measured), ('ml', low), ('b', plain[:, k]), ('a', better[:, k]),
                ('bl', smooth[id(plain)][:, k]), ('al', smooth[id(better)][:, k]),
            )  # fmt: skip
            for name, values in parts:
                rows[name].append(values[block][good])
            for side, rows_of in enumerate((plain, better)):
                white = whitened[id(rows_of)][block, k][good]
                energy[i, side, k] = float(np.sum(white**2)) * channels_used[k]
                plainly[i, side, k] = float(np.sum(rows_of[block, k][good] ** 2)) / own
        joined = {name: np.concatenate(parts) for name, parts in rows.items()}
        if len(joined['m']) < 8:
            continue
        channels[channel] = _channel(joined, own)
    rng = np.random.default_rng(seed)
    picks = rng.integers(0, len(seen), (DRAWS, len(seen)))
    drawn = energy[picks].sum(axis=1)
    as_it_is = plainly[picks].sum(axis=1)
    cuts, acting = _acting(stage, [block for block, _, _ in seen], change, channels_used)
    counts = observation.valid & channels_used
    there = np.array(
        [
            [np.sum((whitened[id(rows)][part] * counts[part]) ** 2) for rows in seen[i][1:]]
            for i, part in acting
        ]
    )
    again = rng.integers(0, len(there), (DRAWS, len(there)))
    low_gain, high_gain = _interval(there[again].sum(axis=1))
    is_open = _per_coefficient(stage, energy[:, 1], seen) > (0.0 if limits is None else limits)
    worse = [
        channel
        for k, channel in enumerate(observation.channels)
        if channel in channels
        and channels_used[k]
        and acted_on[k]
        and is_open[k]
        and _is_worse(drawn[:, :, k])
        and _is_worse(as_it_is[:, :, k])
    ]
    if len(acting) < cuts * len(seen):
        unit = 'blocks' if cuts == 1 else f'blocks cut in {cuts}'
        split = f'{split}; the effects act in {len(acting)} of {cuts * len(seen)} {unit}'
    whole_low, _ = _interval(drawn.sum(axis=2))
    return HeldOut(
        split,
        len(acting),
        channels,
        low_gain,
        high_gain,
        whole_low,
        low_gain > ROUNDING,
        tuple(worse),
    )


def undecided(
    stage: Stage, seen: Sequence[Seen], change: Floats, channels_used: np.ndarray
) -> str | None:
    """Return why held-out blocks without significant gain say nothing of effects; None where they do.

    A rail's step is felt by one step's accelerometer once a loop: a second loop that ends before has no second
    look at it, and one that does not has one event, which a bootstrap draws or misses.

    Parameters
    ----------
    stage : Stage
    seen : sequence of Seen
    change : (n, c) float64
        What the effects do.
    channels_used : (c,) bool
    """
    power = np.sum(stage.whiten.along(change)[:, channels_used] ** 2, axis=1)
    expected = float(sum(np.sum(power[block]) for block, _, _ in seen))
    if expected < SHOWN:
        return f'the effects would show by {expected:.0f} of chi squared, a sure look takes {SHOWN:.0f}'
    whitened = {
        id(rows): stage.whiten.along(_held(rows, seen)) for _, *both in seen for rows in both
    }
    counts = stage.observation.valid & channels_used
    fall = 0.0
    for block, plain, better in seen:
        before, after = (
            float(np.sum((whitened[id(rows)][block] * counts[block]) ** 2))
            for rows in (plain, better)
        )
        fall += before - after
    most = 0.0
    for parts in PARTS:
        cut = np.array(
            [np.sum(power[part]) for block, _, _ in seen for part in _cut(block, parts)]
        )
        most = max(most, float(np.sum(cut) ** 2 / np.sum(cut**2)))
    if most < LEAST_BLOCKS and fall > 0.5 * expected:
        return (
            f'the effects pass once, and explain {fall:.0f} of the {expected:.0f} of chi squared that '
            f'they should there: too few blocks for a bootstrap'
        )
    return None


def _held(rows: Floats, seen: Sequence[Seen]) -> Floats:
    """Return a residual with 0 where it is not held out, (n, c).

    There the instruments' slow nuisance is that of other samples; its mean over the recording has no
    weight, and would be taken off what is held out.
    """
    held = np.zeros_like(rows)
    for block, plain, better in seen:
        if rows is plain or rows is better:
            held[block] = rows[block]
    return held


def _acting(
    stage: Stage, blocks: Sequence[slice], change: Floats | None, channels_used: np.ndarray
) -> tuple[int, list[tuple[int, slice]]]:
    """Return the fewest blocks or parts of blocks that hold nearly all of what effects do.

    A rail's step is felt by one step's accelerometer for a tenth of a second a loop, in one block. Blocks
    are cut until there are six parts; where there never are, it is the six whole blocks with most.

    Returns
    -------
    parts : int
        In which every block is cut.
    acting : list of (int, slice)
        Of which block, and where.
    """
    every = list(enumerate(blocks))
    if change is None:
        return 1, every
    white = np.sum(stage.whiten.along(change)[:, channels_used] ** 2, axis=1)
    for parts in PARTS:
        cut = [(i, part) for i, block in every for part in _cut(block, parts)]
        energy = np.array([np.sum(white[part]) for _, part in cut])
        order = np.argsort(-energy, kind='stable')
        held = np.cumsum(energy[order])
        if held[-1] <= 0.0:
            return 1, every
        count = int(np.searchsorted(held, ACTS * held[-1])) + 1
        if parts == PARTS[0]:
            whole = [every[k] for k in sorted(order[: max(count, LEAST_BLOCKS)].tolist())]
        if count >= LEAST_BLOCKS:
            return parts, [cut[k] for k in sorted(order[:count].tolist())]
    return 1, whole


def _cut(block: slice, parts: int) -> list[slice]:
    """Return a block's equal parts."""
    edges = np.linspace(block.start, block.stop, parts + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def _interval(drawn: Floats) -> tuple[float, float]:
    """Return the 95 % interval of the relative fall of energies before and after, (draws, 2)."""
    gains = 1.0 - drawn[:, 1] / np.maximum(drawn[:, 0], 1e-30)
    low, high = np.quantile(gains, (0.025, 0.975))
    return float(low), float(high)


def _is_worse(drawn: Floats) -> bool:
    """Tell whether a channel's amplitude surely rises, and by more than `WORSE`."""
    total = drawn.mean(axis=0)
    risen = float(np.sqrt(total[1] / max(float(total[0]), 1e-30))) - 1.0
    return risen > WORSE and _interval(drawn)[1] < 0.0


def _per_coefficient(stage: Stage, energy: Floats, seen: Sequence[Seen]) -> Floats:
    """Return chi squared per coefficient of whitened energies (blocks, c) on held-out samples, (c,)."""
    whiten = stage.whiten
    samples = sum(block.stop - block.start for block, _, _ in seen)
    count = samples * len(whiten.weight) / len(whiten.mask)
    return np.asarray(whiten.temperature * energy.sum(axis=0) / count)


def _channel(rows: dict[str, Floats], variance: float) -> dict[str, float]:
    """Return the scores of one channel on its held-out samples."""
    spread = max(float(np.std(rows['ml'])), 1e-12)
    band = max(float(np.std(rows['m'])), 1e-12)

    def correlation(residual: Floats) -> float:
        simulated = rows['ml'] - residual
        if np.std(simulated) == 0.0 or np.std(rows['ml']) == 0.0:
            return 0.0
        return float(np.corrcoef(rows['ml'], simulated)[0, 1])

    return {
        'nrmse_before': float(np.std(rows['bl']) / spread),
        'nrmse_after': float(np.std(rows['al']) / spread),
        'r_time_before': correlation(rows['bl']),
        'r_time_after': correlation(rows['al']),
        'nrmse_band_before': float(np.std(rows['b']) / band),
        'nrmse_band_after': float(np.std(rows['a']) / band),
        'chi2_before': float(np.mean(rows['b'] ** 2) / variance),
        'chi2_after': float(np.mean(rows['a'] ** 2) / variance),
    }
