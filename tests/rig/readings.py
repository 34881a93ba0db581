"""How the recordings decide between readings of the data sheet: ``python -m rig readings``."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from rig.comparison import BANDS_HZ, Channels, channels_of, compare, NOISE, rate_of, TENSIONER
from rig.draw import build, lay_rails, Tolerances
from rig.guide import read_survey, tabulate
from rig.machine import slope, SURVEY
from rig.measured import Measured, read_measured
from rig.model import Model, READINGS
from rig.sheet import Sheet
from rig.tolerances import explain, tolerance_loops
from rig.travel import fit_travel, mean_speed, steady_loop, Travel
from rig.verify import best_phase, follow, PHASES, read_labels, with_effects

FloatArray = NDArray[np.float64]

SHOWN = (
    'link_force/left_a',
    'link_force/right_b',
    'tensioner/displacement',
    'step/acceleration/x',
    'step/acceleration/z',
)
SPECTRAL_BANDS_HZ = (
    (2, 5),
    (5, 6.5),
    (6.5, 10),
    (10, 20),
    (20, 40),
    (40, 60),
    (60, 70),
    (70, 80),
    (80, 90),
    (90, 100),
)
CREEP_SPEEDS_M_S = (2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3)
FORCE_STEP = 0.1  # -, of the label, of the difference quotient
SEGMENT = 1024  # samples, of a spectrum


def with_reading(model: Model, name: str) -> Model:
    """Return the model with one reading turned to the other."""
    reading = model.reading.copy()
    reading[READINGS.index(name)] = 0.0
    return model._replace(reading=reading)


def with_table_rail(model: Model, smooth: bool) -> Model:
    """Return the model on the survey as it is: straight lines between rows, or a spline."""
    survey = read_survey(SURVEY)
    length = model.cell * model.lateral.size
    normal, lateral = (tabulate(survey[:, 0], survey[:, k], length, smooth) for k in (1, 2))
    return model._replace(
        normal=np.stack([normal, normal]),
        normal_slope=np.stack([slope(normal, model.cell)] * 2),
        lateral=lateral,
        lateral_slope=slope(lateral, model.cell),
    )


def residuals(measured: Measured, said: Channels) -> str:
    """Return the shown channels' 20 Hz residuals in one line."""
    figures = compare(channels_of(measured), said)[20.0]
    return '  '.join(
        f'{figures[name].residual * (1e3 if "tens" in name else 1.0):8.4g}' for name in SHOWN
    )


def ratios(measured: Measured, said: Channels, name: str) -> str:
    """Return measured over said amplitude per band, the sensor's noise taken out."""
    rate = rate_of(name)
    frequency, theirs = welch(channels_of(measured)[name], rate, nperseg=SEGMENT)
    _, ours = welch(said[name], rate, nperseg=SEGMENT)
    noise = NOISE[name] ** 2 / (rate / 2.0)
    parts = []
    for low, high in SPECTRAL_BANDS_HZ:
        band = (frequency >= low) & (frequency < high)
        power = np.sum(theirs[band] - noise)
        parts.append(f'{np.sqrt(max(power, 0.0) / np.sum(ours[band])):5.2f}')
    return ' '.join(parts)


def base_of(path: Path) -> tuple[Measured, Model, Travel]:
    """Return a recording, the nominal machine for it and the fitted travel."""
    measured = read_measured(path)
    speed = mean_speed(measured, Sheet().pitch_m)
    model = lay_rails(build(Sheet(), measured.case, speed, Tolerances()), None)
    return measured, model, fit_travel(measured, steady_loop(model), speed)


def show_rails(seeded: Path) -> None:
    """Print clean_2 beside the machine on three rails and with two laws read otherwise."""
    measured, model, travel = base_of(seeded / 'clean_2')
    variants = {
        'as adopted': model,
        'rail: spline through the survey': with_table_rail(model, True),
        'rail: straight lines': with_table_rail(model, False),
        'no drag on the carriage': with_reading(model, 'drag_on_carriage'),
        'damper against a fixed line': with_reading(model, 'moving_line'),
    }
    print(f'clean_2, residuals below 20 Hz (N, N, mm, m/s2, m/s2) of {", ".join(SHOWN)}')
    said = {name: follow(variant, travel, measured) for name, variant in variants.items()}
    for name, channels in said.items():
        print(f'  {name:34s} {residuals(measured, channels)}')
    print('clean_2, measured over simulated amplitude, noise taken out, per band in Hz')
    print(' ' * 56 + ' '.join(f'{low:g}-{high:g}' for low, high in SPECTRAL_BANDS_HZ))
    for name in list(variants)[:3]:
        for channel in (SHOWN[0], *SHOWN[3:]):
            print(f'  {name:32s} {channel:20s} {ratios(measured, said[name], channel)}')


def show_treads(seeded: Path) -> None:
    """Print roller_eccentricity beside three readings of a high tread."""
    measured, model, travel = base_of(seeded / 'roller_eccentricity')
    effects = read_labels(seeded / 'labels.yaml')['roller_eccentricity']
    base, truth = follow(model, travel, measured), channels_of(measured)
    print(f'roller_eccentricity, residuals below 20 Hz of {", ".join(SHOWN)}')
    print(f'  {"without the label":34s} {residuals(measured, base)}')
    readings = {
        'as adopted': model,
        'the centre is shifted': with_reading(model, 'tread_on_both'),
        'drag by both contacts': with_reading(model, 'net_normal'),
    }
    for name, read in readings.items():
        tried = [follow(with_effects(read, effects, p), travel, measured) for p in PHASES]
        phase = best_phase(truth, base, tried)
        said = follow(with_effects(read, effects, phase), travel, measured)
        print(f'  {name:34s} {residuals(measured, said)}')


def show_creep(seeded: Path) -> None:
    """Print tensioner_friction beside dry friction that saturates at several speeds."""
    measured, model, _ = base_of(seeded / 'tensioner_friction')
    label = read_labels(seeded / 'labels.yaml')['tensioner_friction'][0].parameters['force_N']
    loops, truth = tolerance_loops(measured, model.speed), channels_of(measured)
    print('tensioner_friction, tolerances and the friction fitted too; residuals (N, mm) below')
    print('2 Hz and below 20 Hz of left_a, right_b, tensioner')
    for creep in CREEP_SPEEDS_M_S:
        some, more = (
            model._replace(dry=share * label, dry_speed=creep) for share in (1.0, 1.0 + FORCE_STEP)
        )
        pair = steady_loop(some), steady_loop(more)
        travel = fit_travel(measured, pair[0], model.speed)
        said = follow(some, travel, measured)
        parts = []
        for cut_hz in BANDS_HZ:
            left = explain(measured, truth, said, loops, travel, cut_hz, {'force': pair})
            force = label * (1.0 + FORCE_STEP * left.found['force'])
            rest = ' '.join(
                f'{left.residual[name] * (1e3 if name == TENSIONER else 1.0):7.4g}'
                for name in SHOWN[:3]
            )
            damping = left.found['tensioner_damping']
            parts.append(f'{rest}   {force:5.1f} N, damper {damping:+.2f} sigma')
        print(f'  saturates at {creep * 1e3:4.1f} mm/s   {"   ".join(parts)}', flush=True)
