"""A machine within its tolerances, drawn; and what is hidden in it, its truth written apart."""

import copy
import json
from pathlib import Path

import numpy as np
import yaml

from belt.chain import read_sheet
from belt.recording import make_recording

# What a good machine may have beside the tolerances of its sheet, one standard deviation: the
# table of causes in the project's contract.
MAY_HAVE = {
    'chain_elongation': 5e-6,
    'tensioner_friction': 10.0,
    'gear_eccentricity': 5e-5,
    'handrail_drag': 10.0,
}
PRELOAD_SD, SPEED_SD = 0.02, 0.01
PARAMETERS = {
    'rolling_resistance': 'factor', 'roller_drag': 'force_N', 'chain_elongation': 'length_m',
    'tensioner_preload': 'factor', 'tensioner_friction': 'force_N',
    'gear_eccentricity': 'amplitude_m', 'handrail_drag': 'force_N', 'gauge_gain': 'factor',
    'gauge_drift': 'strain', 'accelerometer_misalignment': 'y_deg',
}  # fmt: skip


def tolerances(path):
    """Return (section, key) -> relative standard deviation of a description."""
    raw = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    return {
        (part, key): float(value['tol'])
        for part, section in raw.items()
        if isinstance(section, dict)
        for key, value in section.items()
        if isinstance(value, dict) and set(value) == {'value', 'tol'}
    }


def draw(path, rng):
    """Return a sheet whose numbers lie within their tolerances, and what else it may have."""
    sheet = copy.deepcopy(read_sheet(path))
    for (part, key), tolerance in tolerances(path).items():
        sheet[part][key] *= 1.0 + tolerance * rng.normal()
    may = {
        name: size * (rng.normal() if name == 'chain_elongation' else abs(rng.normal()))
        for name, size in MAY_HAVE.items()
    }
    may['tensioner_preload'] = 1.0 + PRELOAD_SD * rng.normal()
    may['gear_phase'] = rng.uniform(0.0, 2.0 * np.pi)
    return sheet, may


def hide(bag, truth, path, seed, hidden, duration_s):
    """Write a recording of a drawn machine with something hidden, and the truth elsewhere.

    Parameters
    ----------
    bag, truth, path : path
        Directory of the recording, JSON of the truth, description of the machine.
    seed : int
        Of tolerances, place, speed and instruments.
    hidden : mapping of cause to size
        With ``roller_drag_axle`` beside ``roller_drag``; factors multiply the drawn machine.
    duration_s : float
    """
    rng = np.random.default_rng(seed)
    sheet, may = draw(path, rng)
    for name, size in hidden.items():
        may[name] = size * may['tensioner_preload'] if name == 'tensioner_preload' else size
    start = rng.uniform(0.0, sheet['chain']['n_links'] * sheet['chain']['pitch_m'] - 0.5)
    speed = 0.5 * (1.0 + SPEED_SD * float(np.clip(rng.normal(), -3.0, 3.0)))
    make_recording(bag, sheet, start, duration_s, int(rng.integers(1 << 30)), may, speed)
    effects = [
        {'cause': name, 'parameters': {PARAMETERS[name]: size} if name in PARAMETERS else {},
         'location': {'axle': int(hidden['roller_drag_axle'])} if name == 'roller_drag' else {}}
        for name, size in hidden.items() if name != 'roller_drag_axle'
    ]  # fmt: skip
    Path(truth).parent.mkdir(parents=True, exist_ok=True)
    Path(truth).write_text(json.dumps({'effects': effects}), encoding='utf-8')
