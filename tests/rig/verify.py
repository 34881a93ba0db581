"""Show the rig beside recordings that others made: ``python -m rig verify --shared DIR``."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from rig.causes import MACHINE_CAUSES
from rig.comparison import (
    ACCELERATIONS,
    acts_most,
    BANDS_HZ,
    CHANNELS,
    Channels,
    channels_of,
    compare,
    Figure,
    FORCES,
    in_band,
    TENSIONER,
)
from rig.draw import build, lay_rails, Tolerances
from rig.faults import FAULTS
from rig.instruments import draw_instruments, LINKS, specific_force
from rig.make import Effect
from rig.measured import Measured, read_measured
from rig.model import Model, RECORD
from rig.run import ROW_S, run
from rig.sheet import Sheet
from rig.tolerances import explain, Explained, tolerance_loops
from rig.travel import fit_travel, mean_speed, SETTLE_S, steady_loop, Travel

TABLE_S = 0.1  # s, between entries of the speed table
LEAD_S = 0.5  # s, run before the first sample and after the last
PHASES = (0.0, 0.5 * np.pi)  # rad, of effects whose phase no label gives
WITH_PHASE = ('drive_ripple', 'drive_hunting', 'roller_eccentricity', 'roller_flat')


def follow(model: Model, travel: Travel, measured: Measured) -> Channels:
    """Run the machine with the rack on the fitted travel; sample it as the recording was."""
    first = min(measured.onboard_s[0], measured.ground_s[0]) - LEAD_S
    last = max(measured.onboard_s[-1], measured.ground_s[-1]) + LEAD_S
    table = np.arange(int((last - first) / TABLE_S) + 3) * TABLE_S
    rack = travel.at(first + table)
    relative = np.gradient(rack, TABLE_S) * model.direction / model.speed - 1.0
    moved = model._replace(wander=relative, wander_step=TABLE_S)
    rows = run(moved, float(rack[0]), SETTLE_S, last - first)
    time_s = first + np.arange(rows.shape[0]) * ROW_S
    channels = {}
    for channel, link in zip(FORCES, LINKS, strict=True):
        column = rows[:, RECORD.index(f'force_{link}')]
        channels[channel] = np.interp(measured.onboard_s, time_s, column)
    lead_s = travel.ground_lead / travel.velocity
    channels[TENSIONER] = np.interp(measured.ground_s + lead_s, time_s, rows[:, RECORD.index('u')])
    force = specific_force(rows, Sheet())
    for k, channel in enumerate(ACCELERATIONS):
        channels[channel] = np.interp(measured.onboard_s, time_s, force[:, k])
    return channels


def with_effects(model: Model, effects: list[Effect], phase: float) -> Model:
    """Put the labelled effects of the machine into the model."""
    rng = np.random.default_rng(0)
    for effect in effects:
        if effect.cause in MACHINE_CAUSES:
            size = dict(effect.parameters)
            if effect.cause in WITH_PHASE:
                size['phase_rad'] = phase
            model = MACHINE_CAUSES[effect.cause](model, effect.location, size, rng)
    return model


def with_faults(said: Channels, effects: list[Effect]) -> Channels:
    """Read the link forces with the labelled gains of their gauges."""
    said = dict(said)
    for effect in effects:
        if effect.cause in FAULTS:
            kit = draw_instruments(np.random.default_rng(0))
            changed = FAULTS[effect.cause].kit(kit, effect.location, effect.parameters)
            gain = (changed.gauge_gain / kit.gauge_gain).mean(axis=1)
            for k, channel in enumerate(FORCES):
                said[channel] = said[channel] * gain[k]
    return said


def best_phase(measured: Channels, base: Channels, quadratures: list[Channels]) -> float:
    """Return the phase (rad) that explains most, from the responses to 0 and 90 degrees."""
    m, b = in_band(measured, BANDS_HZ[-1]), in_band(base, BANDS_HZ[-1])
    tried = [in_band(channels, BANDS_HZ[-1]) for channels in quadratures]
    columns: list[list] = [[], []]
    target = []
    for name in (*FORCES, TENSIONER):
        scale = 1.0 / (m[name] - b[name]).std()
        for k in (0, 1):
            change = (tried[k][name] - b[name]) * scale
            columns[k].append(change - change.mean())
        left = (m[name] - b[name]) * scale
        target.append(left - left.mean())
    design = np.stack([np.concatenate(c) for c in columns], axis=1)
    found = np.linalg.lstsq(design, np.concatenate(target), rcond=None)[0]
    return float(np.arctan2(found[1], found[0]))


@dataclass(frozen=True)
class Verdict:
    """One recording beside the rig: figures without and with the labelled effects."""

    name: str
    speed_m_s: float
    without: dict[float, dict[str, Figure]]
    with_label: dict[float, dict[str, Figure]] | None
    most: tuple[float, str] | None  # band and channel where the label acts most
    explained: Explained | None  # what is left after the tolerances are fitted as well


def verify_one(path: Path, effects: list[Effect], fit_tolerances: bool = False) -> Verdict:
    """Compare one recording with the nominal machine, without and with its label."""
    measured = read_measured(path)
    sheet = Sheet()
    speed = mean_speed(measured, sheet.pitch_m)
    model = lay_rails(build(sheet, measured.case, speed, Tolerances()), None)
    truth = channels_of(measured)
    travel = fit_travel(measured, steady_loop(model), speed)
    base = follow(model, travel, measured)
    without = compare(truth, base)
    if not effects:
        loops = tolerance_loops(measured, speed) if fit_tolerances else []
        fitted = explain(measured, truth, base, loops, travel) if loops else None
        return Verdict(path.name, speed, without, None, None, fitted)
    phase = 0.0
    if any(effect.cause in WITH_PHASE for effect in effects):
        tried = [follow(with_effects(model, effects, p), travel, measured) for p in PHASES]
        phase = best_phase(truth, base, tried)
        altered = with_effects(model, effects, phase)
    else:  # the same in every loop: find speed and position again
        altered = with_effects(model, effects, phase)
        travel = fit_travel(measured, steady_loop(altered), speed)
    said = with_faults(follow(altered, travel, measured), effects)
    unchanged = base if phase else follow(model, travel, measured)
    most = acts_most(unchanged, said)
    loops = tolerance_loops(measured, speed) if fit_tolerances else []
    fitted = explain(measured, truth, said, loops, travel) if loops else None
    return Verdict(path.name, speed, without, compare(truth, said), most, fitted)


def read_labels(path: Path) -> dict[str, list[Effect]]:
    """Read the seeded recordings' labels."""
    labels = yaml.safe_load(path.read_text())
    return {
        name: [Effect(e['cause'], e.get('location', {}), e.get('parameters', {})) for e in effects]
        for name, effects in labels.items()
    }


def show(verdict: Verdict) -> None:
    """Print one recording's figures."""
    print(f'\n{verdict.name}: {verdict.speed_m_s:.4f} m/s; residuals rms in N, mm, m/s2')
    print(
        f'  {"channel":24s} {"band":>6s} {"signal":>9s} {"noise":>8s}   r without  residual'
        '      r with  residual  ratio'
    )
    for cut_hz in BANDS_HZ:
        for name in CHANNELS:
            a = verdict.without[cut_hz][name]
            scale = 1e3 if name == TENSIONER else 1.0
            line = (
                f'  {name:24s} {cut_hz:3.0f} Hz {a.signal * scale:9.4g} '
                f'{a.noise * scale:8.2g}   {a.r:9.6f} {a.residual * scale:9.4g}'
            )
            if verdict.with_label is not None:
                b = verdict.with_label[cut_hz][name]
                line += f'   {b.r:9.6f} {b.residual * scale:9.4g} {b.residual / a.residual:6.2f}'
            print(line + ('  <- acts most' if (cut_hz, name) == verdict.most else ''))


def show_explained(explained: Explained) -> None:
    """Print what is left after the tolerances are fitted, and the tolerances found."""
    left = ', '.join(
        f'{name.split("/")[-1]} {value * (1e3 if name == TENSIONER else 1.0):.3g}'
        for name, value in explained.residual.items()
    )
    found = ', '.join(f'{name} {value:+.1f}' for name, value in explained.found.items())
    print(f'  2 Hz residual with tolerances fitted too: {left}')
    print(f'  tolerances found, standard deviations: {found}')


def verify(shared: Path, names: list[str], fit_tolerances: bool = False) -> None:
    """Print every seeded recording beside the rig."""
    seeded = shared / 'measured' / 'seeded'
    labels = read_labels(seeded / 'labels.yaml')
    for name in names or labels:
        verdict = verify_one(seeded / name, labels[name], fit_tolerances)
        show(verdict)
        if verdict.explained is not None:
            show_explained(verdict.explained)


def beside(bags: list[Path]) -> None:
    """Print other recordings, such as the twin's own, beside the nominal rig."""
    for bag in bags:
        show(verify_one(bag, []))
