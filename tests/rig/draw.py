"""Draw one machine within the data sheet's tolerances, its rails and one run's speed."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from rig.guide import read_survey, TABLE_STEP_M
from rig.machine import Case, nominal, slope, survey_of
from rig.model import Model
from rig.sheet import chosen, Sheet

FloatArray = NDArray[np.float64]

SURVEY_ERROR_M = 5e-5  # m, data sheet, one standard deviation
WAVE_AMPLITUDE_M = {'normal': 2.1e-5, 'lateral': 3.5e-5}  # m at one wave per metre, as surveyed
SURVEYED_WAVE_M = 0.125  # m; the reference rig's rail has no shorter waves (docs/generator.md)
SHORTEST_WAVE_M = 0.05  # m
SHORT_SHARE = 0.1  # -, of the spectrum's continuation, in waves between these two lengths
WANDER = 0.002  # -, data sheet, largest slow wander of the speed
WANDER_PERIOD_S = 32.0  # s, the shortest
WANDER_STEP_S = 0.1  # s, between the wander's table entries
LARGEST_SPEED_ERROR = 0.07  # -, data sheet


@dataclass(frozen=True)
class Tolerances:
    """One machine's draw: factors on the data sheet's values, lengths in m."""

    mass: float = 1.0
    link_stiffness: float = 1.0
    link_damping: float = 1.0
    racking_stiffness: float = 1.0
    contact_stiffness: float = 1.0
    rolling_resistance: float = 1.0
    drive_stiffness: float = 1.0
    tensioner_stiffness: float = 1.0
    tensioner_damping: float = 1.0
    preload: float = 1.0
    load: float = 1.0
    lower_landing_m: float = 0.0
    upper_landing_m: float = 0.0


SPREAD = {  # one standard deviation, data sheet
    'mass': 0.01,
    'link_stiffness': 0.05,
    'link_damping': 0.3,
    'racking_stiffness': 0.2,
    'contact_stiffness': 0.1,
    'rolling_resistance': 0.1,
    'drive_stiffness': 0.1,
    'tensioner_stiffness': 0.02,
    'tensioner_damping': 0.15,
    'preload': 0.02,
    'load': 0.01,
    'lower_landing_m': 1e-3,
    'upper_landing_m': 1e-3,
}
LARGEST_DRAW = 2.5  # standard deviations; a machine further out is not within tolerance


def draw_tolerances(rng: np.random.Generator) -> Tolerances:
    """Draw one machine; every draw stays within 2.5 standard deviations."""
    drawn = {}
    for name, spread in SPREAD.items():
        deviation = spread * float(np.clip(rng.normal(), -LARGEST_DRAW, LARGEST_DRAW))
        drawn[name] = deviation if name.endswith('_m') else 1.0 + deviation
    return Tolerances(**drawn)


def build(sheet: Sheet, case: Case, speed_m_s: float, drawn: Tolerances) -> Model:
    """Return the machine with these tolerances, its guide as surveyed."""
    model = nominal(
        sheet,
        case,
        speed_m_s,
        smooth=True,
        lower_m=drawn.lower_landing_m,
        upper_m=drawn.upper_landing_m,
    )
    return model._replace(
        mass=model.mass * drawn.mass,
        lat_mass=model.lat_mass * drawn.mass,
        link_k=model.link_k * drawn.link_stiffness,
        link_c=model.link_c * drawn.link_damping,
        rack_k=model.rack_k * drawn.racking_stiffness,
        contact_k=model.contact_k * drawn.contact_stiffness,
        resistance=model.resistance * drawn.rolling_resistance,
        drive_k=model.drive_k * drawn.drive_stiffness,
        tens_k=model.tens_k * drawn.tensioner_stiffness,
        tens_c=model.tens_c * drawn.tensioner_damping,
        preload=model.preload * drawn.preload,
        load=model.load * drawn.load,
    )


def surveyed_waves(
    s: FloatArray,
    values: FloatArray,
    length_m: float,
    amplitude_m: float,
    rng: np.random.Generator | None,
) -> NDArray[np.complex128]:
    """Return the complex amplitudes (m) of a rail's waves, given its survey, from the mean on.

    Each row of the survey sees the sum of all waves at its own place, and a white error: one
    linear Gaussian problem.  The last row stands a few millimetres before the seam, so that the
    rows are not evenly spaced round the loop.
    """
    k = np.arange(1, int(length_m / SURVEYED_WAVE_M) + 1)
    angle = 2.0 * np.pi * np.outer(s / length_m, k)
    seen = np.column_stack([np.ones(s.size), np.cos(angle), np.sin(angle)]) / SURVEY_ERROR_M
    spread = np.tile(amplitude_m * length_m / k, 2)  # of cosines and sines
    known = seen.T @ seen
    known[1:, 1:] += np.diag(spread**-2.0)
    root = np.linalg.cholesky(known)
    waves = np.linalg.solve(root, seen.T @ (values / SURVEY_ERROR_M))
    if rng is not None:
        waves = waves + rng.normal(size=waves.size)
    waves = np.linalg.solve(root.T, waves)
    return np.append(waves[0] + 0j, 0.5 * (waves[1 : k.size + 1] - 1j * waves[k.size + 1 :]))


def true_rail(
    s: FloatArray,
    values: FloatArray,
    length_m: float,
    amplitude_m: float,
    rng: np.random.Generator | None,
) -> FloatArray:
    """Return a true rail, given what the survey says of it, on the rig's table.

    The true deviation's amplitude per wave falls as 1 / (waves per metre), as the survey's
    own spectrum does below 4 per metre; the survey adds white errors.  The waves are drawn from
    their posterior, shorter ones from a share of the prior.  Without a generator: the
    posterior's mean.
    """
    table = round(length_m / TABLE_STEP_M)
    surveyed = surveyed_waves(s, values, length_m, amplitude_m, rng)
    true = np.zeros(table // 2 + 1, complex)
    true[: surveyed.size] = surveyed
    if rng is not None:
        k = np.arange(surveyed.size, int(length_m / SHORTEST_WAVE_M) + 1)
        draw = (rng.normal(size=k.size) + 1j * rng.normal(size=k.size)) * np.sqrt(0.5)
        true[k] = SHORT_SHARE * np.sqrt(0.5) * amplitude_m * length_m / k * draw
    return np.fft.irfft(true, table) * table


def lay_rails(model: Model, rng: np.random.Generator | None) -> Model:
    """Give the machine a true guide, drawn or the likeliest: one for both sides."""
    survey = read_survey(survey_of(chosen()))
    length = model.cell * model.lateral.size
    s = survey[:, 0]
    normal = true_rail(s, survey[:, 1], length, WAVE_AMPLITUDE_M['normal'], rng)
    lateral = true_rail(s, survey[:, 2], length, WAVE_AMPLITUDE_M['lateral'], rng)
    return model._replace(
        normal=np.stack([normal, normal]),
        normal_slope=np.stack([slope(normal, model.cell)] * 2),
        lateral=lateral,
        lateral_slope=slope(lateral, model.cell),
    )


@dataclass(frozen=True)
class Wander:
    """Of how many waves a drive's slow wander is drawn, and of which periods; as other makers' by default."""

    least_waves: int = 1
    most_waves: int = 3
    longest_s: float = 120.0


def draw_wander(
    rng: np.random.Generator, duration_s: float, kind: Wander | None = None
) -> FloatArray:
    """Draw the slow wander: relative speed, ``WANDER_STEP_S`` apart, mean zero in sum."""
    kind = kind or Wander()
    count = kind.most_waves
    if kind.least_waves < count:
        count = int(rng.integers(kind.least_waves, count + 1))
    share = rng.dirichlet(np.ones(count)) * WANDER * rng.uniform(0.3, 1.0)
    period = rng.uniform(WANDER_PERIOD_S, kind.longest_s, count)
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    time_s = np.arange(int(duration_s / WANDER_STEP_S) + 2) * WANDER_STEP_S
    waves = share[:, None] * np.sin(2.0 * np.pi * time_s / period[:, None] + phase[:, None])
    return waves.sum(axis=0)


def draw_speed(rng: np.random.Generator, set_speed_m_s: float) -> float:
    """Draw the real mean speed (m/s)."""
    return set_speed_m_s * (1.0 + rng.uniform(-LARGEST_SPEED_ERROR, LARGEST_SPEED_ERROR))


def as_truth(drawn: Tolerances) -> dict[str, float]:
    """Return the draw for the truth file."""
    return {name: float(value) for name, value in asdict(drawn).items()}
