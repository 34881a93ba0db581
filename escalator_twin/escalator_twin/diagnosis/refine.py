"""Simulate what a search proposes, and fit its numbers by Gauss-Newton steps."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from math import inf

import numpy as np

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted, inner_products, inverse
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.errors import EscalatorError
from escalator_twin.signals import Floats

STEPS = 3
SHORTER_M = 0.02  # than the design path may a machine's be, its tolerances turned
SHARES = (1.0, 0.4)  # of a step that are tried
SETTLED = 0.5  # a fit ends when chi squared is predicted to fall by less than this

# Differences for parameters that do not size an effect, and for places along the guide.
NUDGES = {
    'phase_rad': 0.2,
    'displacement_m': 1e-4,
    '@s_m': 0.01,
    '@s_from_m': 0.01,
    '@s_to_m': 0.01,
    'frequency_hz': 5e-4,
    'cycles_per_pitch': 5e-4,
    'damping_ratio': 5e-3,
    'slip': 1e-4,
}
NUDGES_OF = {
    ('guide_step', 'length_m'): 5e-3,
    ('truss_resonance', 'frequency_hz'): 0.03,
    # a spot is 0.35 rad wide
    ('roller_flat', 'phase_rad'): 0.05,
    ('roller_flat', 'slip'): 3e-5,
}
# Of sizes that are differentiated where they are, a good part of the size: two runs differ by rattling
# as well, and a small difference would be made of that.
NUDGE_SHARE = 0.35
LEAST_NUDGE = {
    ('tensioner_friction', 'force_N'): 20.0,
    ('tensioner_stiffness', 'factor'): 0.04,
    ('tensioner_preload', 'factor'): 0.04,
    ('rolling_resistance', 'factor'): 0.15,
    ('landing_length', 'delta_m'): 2e-3,
    ('chain_elongation', 'length_m'): 1e-5,
}
# Sizes whose response bends: dry friction, stops and springs near a resonance.
BENT = {
    ('tensioner_friction', 'force_N'),
    ('tensioner_stiffness', 'factor'),
    ('drive_stiffness', 'factor'),
    ('rolling_resistance', 'factor'),
    ('tensioner_preload', 'factor'),
    ('landing_length', 'delta_m'),
    ('chain_elongation', 'length_m'),
}
# Parameters that act as their inverse: a softer spring's response is linear in compliance.
INVERSE = {
    ('drive_stiffness', 'factor'),
    ('link_stiffness', 'factor'),
    ('truss_resonance', 'modal_mass_kg'),
}


@dataclass(frozen=True)
class Refined:
    """A proposal after its simulation.

    Attributes
    ----------
    proposal : Proposal
        With the fitted numbers.
    model : (n, c) float64
        The machine with it.
    fitted : Fitted
        What is left, with the nuisance.
    gain : float
        By how much chi squared fell, simulated.
    sd : mapping of parameter to float
    jacobian : (m, p) float32
        Whitened columns of the fitted parameters.
    """

    proposal: Proposal
    model: Floats
    fitted: Fitted
    gain: float
    sd: Mapping[str, float]
    jacobian: np.ndarray
    keys: tuple[str, ...]


def value_of(proposal: Proposal, key: str) -> float:
    """Return a parameter, or a place with ``@`` before its key."""
    if key.startswith('@'):
        place = proposal.location[key[1:]]
        assert isinstance(place, float)
        return place
    return proposal.parameters[key]


def on_path(place_m: float, length_m: float) -> float:
    """Return a place on the path of every machine within tolerance, m; ``length_m`` is the design's."""
    return float(np.clip(place_m, 0.0, length_m - SHORTER_M))


def changed(proposal: Proposal, values: Mapping[str, float], length_m: float) -> Proposal:
    """Return a proposal with other numbers, within the bounds of its cause."""
    parameters, location = dict(proposal.parameters), dict(proposal.location)
    bounds = {p.name: (p.low, p.high) for p in KNOWN[proposal.cause].parameters}
    for key, value in values.items():
        if key.startswith('@'):
            location[key[1:]] = on_path(value, length_m)
        else:
            low, high = bounds[key]
            if key == 'phase_rad':
                value = float((value + np.pi) % (2.0 * np.pi) - np.pi)
            parameters[key] = float(np.clip(value, low, min(high, 1e9)))
    return replace(proposal, parameters=parameters, location=location)


def refine(
    stage: Stage, base: Floats, fitted: Fitted, proposal: Proposal, steps: int = STEPS
) -> Refined | None:
    """Fit a proposal's numbers with the twin itself.

    Parameters
    ----------
    stage : Stage
    base : (n, c) float64
        The stage's model without the proposal.
    fitted : Fitted
        What that leaves, with the nuisance.
    proposal : Proposal
    steps : int
        Gauss-Newton steps at most.

    Returns
    -------
    refined : Refined or None
        None where the machine cannot be run with it.
    """
    without = proposal.nuisance if proposal.nuisance in stage.turned else None
    length = stage.machine_length
    keys = proposal.fitted
    try:
        current = stage.run((proposal.deviation,), without)
    except EscalatorError:
        return None
    best = _weigh(stage, current, proposal, fitted)
    judged = partial(stage.judged, cause=proposal.cause)
    before = judged(fitted)
    jacobian = jacobian_of(stage, base, current, proposal, without)
    for _ in range(steps):
        right, gram = inner_products(best, jacobian)
        step = inverse(gram) @ right
        if right @ step < SETTLED:
            break
        trial, model, after = proposal, current, best
        for shrink in SHARES:
            way = {
                key: moved(proposal, key, shrink * float(delta))
                for key, delta in zip(keys, step, strict=True)
            }
            trial = changed(proposal, way, length)
            try:
                model = stage.run((trial.deviation,), without)
            except EscalatorError:
                continue
            after = _weigh(stage, model, trial, fitted)
            if judged(after) < judged(best):
                break
        if judged(after) >= judged(best):
            break
        gained = judged(best) - judged(after)
        proposal, current, best = trial, model, after
        if gained < 0.02 * (before - judged(best)) and gained < 6.0:
            break
        if len(keys) == 1:
            jacobian = jacobian_of(stage, base, current, proposal, without)
    _, gram = inner_products(best, jacobian)
    covariance = inverse(gram)
    sd = {
        key: abs(slope_of(proposal, key)) * float(np.sqrt(max(covariance[i, i], 0.0)))
        for i, key in enumerate(keys)
    }
    return Refined(proposal, current, best, before - judged(best), sd, jacobian, keys)


def _weigh(stage: Stage, model: Floats, proposal: Proposal, before: Fitted) -> Fitted:
    """Fit the nuisance, without the one that the proposal stands for."""
    fitted = stage.fit_shifted(model, before)
    if proposal.nuisance in stage.nuisance.names:
        return fitted.without(stage.nuisance.names.index(str(proposal.nuisance)))
    return fitted


def _inner(proposal: Proposal, key: str, value: float) -> float:
    """Return the variable in which the response is about linear."""
    return 1.0 / value if (proposal.cause, key) in INVERSE else value


def slope_of(proposal: Proposal, key: str) -> float:
    """Return by how much a parameter changes with that variable."""
    value = value_of(proposal, key)
    return -value * value if (proposal.cause, key) in INVERSE else 1.0


def moved(proposal: Proposal, key: str, delta: float) -> float:
    """Return a parameter after a step of the variable."""
    value = value_of(proposal, key)
    if (proposal.cause, key) in INVERSE:
        return 1.0 / max(1.0 / value + delta, 1e-3 / abs(value))
    return value + delta


def jacobian_of(
    stage: Stage,
    base: Floats | None,
    model: Floats,
    proposal: Proposal,
    without: str | None = None,
    jobs: int = 1,
) -> np.ndarray:
    """Return whitened columns: a secant for what sizes the effect, differences for the rest.

    Parameters
    ----------
    stage : Stage
        Without the proposal.
    base : (n, c) float64 or None
        Its model; None: run it where it is needed.
    model : (n, c) float64
        With the proposal.
    proposal : Proposal
    without : str, optional
        Tolerance that the proposal stands for.
    jobs : int
        Simulations at a time.

    Returns
    -------
    columns : (m, p) float32
        One for each fitted number, by the variable in which the response is about linear.
    """
    length = stage.machine_length

    def column(key: str) -> Floats:
        value = value_of(proposal, key)
        neutral = _neutral(stage, proposal, key)
        if key == proposal.fitted[0] and neutral is not None and not _is_bent(proposal, key):
            start = stage.run((), without) if base is None else base
            way = _inner(proposal, key, value) - _inner(proposal, key, neutral)
            return (model - start) / (way if abs(way) > 1e-12 else 1e-12)
        nudge = _nudge(proposal, key, value, neutral)
        trial = changed(proposal, {key: value + nudge}, length)
        way = _inner(proposal, key, value_of(trial, key)) - _inner(proposal, key, value)
        if way == 0.0:
            trial = changed(proposal, {key: value - nudge}, length)
            way = _inner(proposal, key, value_of(trial, key)) - _inner(proposal, key, value)
        return (stage.run((trial.deviation,), without) - model) / way

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        columns = list(pool.map(column, proposal.fitted))
    return stage.columns(np.stack(columns, axis=2), proposal.cause)


def _is_bent(proposal: Proposal, key: str) -> bool:
    """Tell whether the response is so far from linear that its slope must be taken locally."""
    return (proposal.cause, key) in BENT


def _nudge(proposal: Proposal, key: str, value: float, neutral: float | None) -> float:
    """Return a small change of a parameter."""
    if (proposal.cause, key) in NUDGES_OF:
        return NUDGES_OF[proposal.cause, key]
    if key in NUDGES:
        return NUDGES[key]
    if (proposal.cause, key) in LEAST_NUDGE:
        least = LEAST_NUDGE[proposal.cause, key]
        return max(NUDGE_SHARE * abs(value - (neutral or 0.0)), least)
    if neutral is not None and value != neutral:
        return 0.1 * (value - neutral)
    return 0.05 * abs(value) or 1e-6


def _neutral(stage: Stage, proposal: Proposal, key: str) -> float | None:
    """Return the value at which the base is what it is."""
    bound = {p.name: p.neutral for p in KNOWN[proposal.cause].parameters}
    neutral = bound.get(key)
    if neutral is None or neutral == inf:
        return None
    if proposal.nuisance in stage.turned:
        tolerance = stage.tolerances.get(str(proposal.nuisance), 0.0)
        return neutral + stage.turned[str(proposal.nuisance)] * tolerance
    return neutral


Runner = Callable[[Proposal], Refined | None]
