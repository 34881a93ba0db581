"""Faults of gauges and accelerometer that the nuisance stands for within tolerance."""

from collections.abc import Iterator

import numpy as np

from escalator_twin.causes.imperfections import creep_shape
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.nuisance import creep_of, creep_tol
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import (
    fit,
    Fitted,
    inner_products,
    score_each,
    score_groups,
    Scores,
)
from escalator_twin.diagnosis.search import Search
from escalator_twin.diagnosis.search_whole import beyond

COMMON_SCALE = 0.02  # of all forces alike, or of a link's two sides, one standard deviation
# The same of a link's two sides where it is asked which of the two gauges is at fault: that one reads 3 % too
# little, or the machine pulls 3 % less on both and the other reads 3 % too much, is one fault against two.
LINK_SCALE = 0.005
CURVATURES = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)  # of a gauge's creep


def _with_common_scales(search: Search, of_link: float = COMMON_SCALE) -> Fitted:
    """Return the fit with more freedom: forces larger or smaller alike, all or a link's two sides.

    That is no gauge's gain but the machine's, whatever does it.
    """
    fitted, model = search.fitted, search.model
    sensors = [search.machine.instruments.sensor(c) for c in search.view.observation.channels]
    links = [s.at.get('link') if s.quantity == 'link_force' else None for s in sensors]
    forces = np.array([s.quantity == 'link_force' for s in sensors])
    known = dict.fromkeys(link for link in links if link is not None)
    groups = [forces, *(np.array([own == link for own in links]) for link in known)]
    groups = [group for group in groups if group.sum() > 1]
    if not groups:
        return fitted
    swing = model - model.mean(axis=0)
    wide = [COMMON_SCALE if group is forces else of_link for group in groups]
    scales = np.stack([by * swing * group for by, group in zip(wide, groups, strict=True)], axis=2)
    columns = np.concatenate([fitted.columns, search.whiten(scales)], axis=1)
    return fit(fitted.white, columns, np.append(fitted.offset, np.zeros(len(groups))))


def _fair_gains(search: Search, beside: Fitted) -> dict[str, float]:
    """Return what each gauge's gain explains, by channel.

    That there is one is told beside forces that may be larger alike; which of a link's two it is, beside
    two that hardly may.
    """
    sensors = {c: search.machine.instruments.sensor(c) for c in search.view.observation.channels}
    at = {c: f'{c}/gain' for c in sensors if f'{c}/gain' in search.names}
    wide, near = (
        {c: beyond(_gain_score(search, place, name)) for c, name in at.items()}
        for place in (beside, _with_common_scales(search, LINK_SCALE))
    )
    found = {}
    for channel, gain in wide.items():
        link = sensors[channel].at.get('link')
        own = [c for c in wide if link is not None and sensors[c].at.get('link') == link]
        best = max(own or [channel], key=lambda c: near[c])
        found[channel] = min(gain, wide[best] - (near[best] - near[channel]))
    return found


def _gain_score(search: Search, place: Fitted, name: str) -> Scores:
    at = search.names.index(name)
    return score_each(place.without(at), place.columns[:, at : at + 1])


def over_shapes(score: Scores) -> tuple[float, float]:
    """Return creep and its standard deviation over all of its shapes, each as far as it is likely.

    Thermal drift hides much of the shape, and the more it bends the smaller the creep comes out.
    """
    likely = np.exp(0.5 * (score.gain - score.gain.max()))
    likely /= likely.sum()
    mean = float(likely @ score.size)
    return mean, float(np.sqrt(likely @ (score.sd**2 + (score.size - mean) ** 2)))


def gains(search: Search) -> Iterator[Proposal]:
    """Propose a gauge's gain and its creep, and the accelerometer's rotation."""
    machine, names = search.machine, search.names
    beside = _with_common_scales(search)
    gain_of = _fair_gains(search, beside)
    (law,) = KNOWN['gauge_gain'].parameters
    part = np.linspace(0.0, 1.0, len(search.model))
    for k, channel in enumerate(search.view.observation.channels):
        sensor = machine.instruments.sensor(channel)
        if f'{channel}/gain' in names:
            score = _gain_score(search, beside, f'{channel}/gain')
            factor = 1.0 + sensor.gain_tol * float(score.size[0])
            if law.low <= factor <= law.high:  # what is no gain of a gauge that works is none
                yield Proposal(
                    'gauge_gain', {'link': sensor.name}, {'factor': factor}, gain_of[channel],
                    {'factor': sensor.gain_tol * float(score.sd[0])}, 4, ('factor',),
                    f'{channel}/gain',
                )  # fmt: skip
        if sensor.thermal_drift > 0.0:
            columns = np.zeros((*search.model.shape, len(CURVATURES)), np.float32)
            for j, c in enumerate(CURVATURES):
                columns[:, k, j] = sensor.scale * sensor.sign * creep_shape(part, c)
            own = creep_of(channel)
            known = [not name.startswith(own) for name in names]
            score = score_each(
                search.fitted.keeping(np.flatnonzero(known)), search.whiten(columns)
            )
            top = int(np.argmax(score.gain))
            strain, sd = over_shapes(score)
            # what chi squared falls by where the prior of a good gauge's creep is lifted
            gain = strain**2 / (creep_tol() ** 2 + sd**2)
            yield Proposal(
                'gauge_drift', {'link': sensor.name},
                {'strain': strain, 'curvature': CURVATURES[top]},
                gain, {'strain': sd}, 4, ('strain',), own,
            )  # fmt: skip
    turned = [names.index(f'rotation/{a}') for a in 'xyz' if f'rotation/{a}' in names]
    if len(turned) == 3:
        tolerance = max(s.rotation_tol_deg for s in machine.instruments.sensors)
        rest = search.fitted
        for at in reversed(turned):
            rest = rest.without(at)
        sizes, _ = score_groups(rest, search.fitted.columns[:, turned], 3)
        _, gram = inner_products(rest, search.fitted.columns[:, turned])
        unsure = np.linalg.inv(gram)
        spread = np.eye(3) + unsure
        gain = float(sizes[0] @ np.linalg.solve(spread, sizes[0]))
        degrees = {f'{a}_deg': float(tolerance * sizes[0, i]) for i, a in enumerate('xyz')}
        spreads = tolerance * np.sqrt(np.diag(unsure))
        yield Proposal(
            'accelerometer_misalignment', {}, degrees, gain,
            dict(zip(degrees, map(float, spreads), strict=True)), 1, tuple(degrees), 'rotation',
        )  # fmt: skip
