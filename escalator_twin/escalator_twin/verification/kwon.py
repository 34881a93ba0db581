"""``python -m escalator_twin.verification.kwon [FOLDER]``: the figures of docs/kwon.md.

Prints every figure beside its bar, `+` or `!`, and exits 1 where one does not hold; with a folder,
draws the pictures like figures 4 to 8 of Kwon, Park and Park into it as well.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import sys
import time

import numpy as np

from escalator_twin.machine import load_machine, Machine, machines_folder, MultibodyMachine
from escalator_twin.physics.multibody import loop
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.layout import lay_out, PARTS
from escalator_twin.physics.multibody.simulation import MultibodySimulation
from escalator_twin.signals import Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.plot import Line, svg
from escalator_twin.verification.rope import handrail_rope, step_rope, straight_places

RATE_HZ = 200.0
PITCHES = 62  # of a steady record: a little more than one loop
START_UP_S = 6.0
STEP = 5
GAL = 100.0  # per m/s2
TO_3_PERCENT = 3.0
PUBLISHED_HZ = (1.22, 2.44, 3.66)
PUBLISHED = 'the paper: simulation 40 gal, experiment 45 gal, at 3.66 Hz'
COUNTS = {
    ('steps',): (174, 523, 174, 1044),
    ('handrail',): (127, 381, 127, 3048),
}
WORDS = ('bodies', 'degrees_of_freedom', 'spring_dampers', 'contact_pairs')
LARGER = ('kwon_30m', 'kwon_walk')


@dataclass(frozen=True)
class Steady:
    """A record at speed, and what it was taken from."""

    simulation: MultibodySimulation
    time_s: Floats
    columns: dict[str, Floats]
    ramp_s: float
    factor: float
    body_ns: float


def build(machine: MultibodyMachine, parts: tuple[str, ...] = PARTS) -> MultibodySimulation:
    """Return the machine's parts, in the experiment of its description."""
    return MultibodySimulation(machine, lay_out(machine, machine.default_experiment(), parts))


def probes_of(simulation: MultibodySimulation) -> dict[str, tuple[int, int, int]]:
    """Return what is recorded, by name."""
    layout, n = simulation.layout, simulation.machine.chain.n_links
    assert layout.handrail is not None
    assert simulation.machine.handrail is not None
    rail, track = layout.first_rail_link, layout.handrail.track
    first = layout.first_rail_point
    row = int(layout.network.point_rows[first, 0]) + track.names.index('incline')
    return {
        'acceleration': (loop.ACCEL_X, n + STEP, 0),
        'step_speed': (loop.BODY_SPEED, n + STEP, 0),
        'place': (loop.POINT_PLACE, STEP, 0),
        'reaction': (loop.POINT_NORMAL, STEP, 0),
        'tension': (loop.LINK_TENSION, STEP, 0),
        'way': (loop.PART_WAY, 0, 0),
        'torque': (loop.TORQUE, 0, 0),
        'pulley': (loop.TORQUE, 1, 0),
        'rail_tension': (loop.LINK_TENSION, rail, 0),
        'rail_mean': (loop.LINK_MEAN, rail, rail + simulation.machine.handrail.n_bodies),
        'rail_place': (loop.POINT_PLACE, first + 1, 0),
        'rail_speed': (loop.SPEED_AT, first, row),
    }


def record(simulation: MultibodySimulation, duration_s: float, ramp_s: float = 0.0) -> Steady:
    """Record from the present state; cost by the thread's own clock."""
    probes = probes_of(simulation)
    begun = time.thread_time()
    rows = simulation.advance(duration_s, RATE_HZ, np.array(list(probes.values())), ramp_s)
    spent = time.thread_time() - begun
    steps = duration_s / simulation.step_s
    columns = dict(zip(probes, rows.T, strict=True))
    at: Floats = np.multiply(np.arange(len(rows)) + 0.5, 1.0 / RATE_HZ, dtype=np.float64)
    each = spent / steps / simulation.counts.bodies
    return Steady(simulation, at, columns, ramp_s, duration_s / spent, 1e9 * each)


def counts(machine: MultibodyMachine) -> Iterator[Figure]:
    """Yield the counts of the built models."""
    for parts, expected in COUNTS.items():
        found = build(machine, parts).counts
        for word, number in zip(WORDS, expected, strict=True):
            value = getattr(found, word)
            yield Figure('counts', f'{parts[0]}: {word.replace("_", " ")}', value, '',
                         number, number)  # fmt: skip


def whole_pitches(machine: MultibodyMachine) -> float:
    """Return the duration of a steady record, s."""
    return PITCHES * machine.chain.pitch_m / machine.experiment.speed_m_s


def speed_of(steady: Steady, machine: MultibodyMachine) -> float:
    """Return the speed of a roller along the straight incline, over whole pitches."""
    row = steady.simulation.network.segments[2]
    way = np.unwrap(steady.columns['place'], period=steady.simulation.path.length_m)
    inside = (steady.columns['place'] > row[seg.START]) & (
        steady.columns['place'] < row[seg.START] + row[seg.LENGTH]
    )
    first = int(np.flatnonzero(inside)[0])
    last = first + int(np.argmin(inside[first:])) if not inside[first:].all() else len(way)
    pitch_s = machine.chain.pitch_m / machine.experiment.speed_m_s
    span = np.floor((last - 1 - first) / RATE_HZ / pitch_s) * pitch_s
    here = np.interp(steady.time_s[first] + span, steady.time_s, way)
    return float((here - way[first]) / span)


def speeds(steady: Steady, machine: MultibodyMachine, subject: str) -> Iterator[Figure]:
    """Yield both steady speeds against what they are driven at."""
    assert machine.handrail is not None
    found = {
        'step speed': (speed_of(steady, machine), machine.experiment.speed_m_s),
        'handrail speed': (
            float(steady.columns['rail_speed'][-len(steady.time_s) // 4 :].mean()),
            machine.handrail.speed_m_s,
        ),
    }
    for name, (value, wanted) in found.items():
        yield Figure(subject, name, 1e3 * value, 'mm/s', 1005.0 * wanted, 995.0 * wanted)


def tensions(steady: Steady, machine: MultibodyMachine) -> Iterator[Figure]:
    """Yield tension over the loop and torque against the rope's balance."""
    subject = 'chain tension and torques against a rope by hand'
    rope = step_rope(machine, machine.default_experiment())
    columns, path = steady.columns, steady.simulation.path
    middle = (columns['place'] + 0.5 * machine.chain.pitch_m) % path.length_m
    for name, begin, end in straight_places(machine):
        here = (middle > begin) & (middle < end)
        off = 100.0 * (columns['tension'][here].mean() / rope.at(middle[here]).mean() - 1.0)
        yield Figure(subject, f'chain tension, {name}: simulated over rope, less 1', off, '%',
                     TO_3_PERCENT, -TO_3_PERCENT)  # fmt: skip
    rail = handrail_rope(machine, float(columns['rail_mean'].mean()))
    assert machine.handrail is not None
    for name, column, by_hand, ratio in (
        ('upper gear', 'torque', rope.torque_n_m, machine.drive.gear_ratio),
        ('driving pulley', 'pulley', rail.torque_n_m, machine.handrail.gear_ratio),
    ):
        value = float(columns[column].mean())
        yield Figure(subject, f'torque at the {name}', value, 'N m')
        yield Figure(subject, f'torque at the motor, {name}', value * ratio, 'N m')
        yield Figure(subject, f'torque at the {name}: simulated over rope, less 1',
                     100.0 * (value / by_hand - 1.0), '%', TO_3_PERCENT, -TO_3_PERCENT)  # fmt: skip


def on_incline(steady: Steady) -> tuple[Floats, Floats]:
    """Return time and forward acceleration while the step is on the incline, whole pitches."""
    machine = steady.simulation.machine
    row = steady.simulation.network.segments[2]
    place = steady.columns['place'] - row[seg.START]
    inside = (place > machine.chain.pitch_m) & (place < row[seg.LENGTH] - machine.chain.pitch_m)
    # the longest stay in the record
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
    begins, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - begins))
    first = int(begins[longest])
    pitch = RATE_HZ * machine.chain.pitch_m / machine.experiment.speed_m_s
    n = round(np.floor((ends[longest] - first) / pitch) * pitch)
    return steady.time_s[first : first + n], steady.columns['acceleration'][first : first + n]


def spectrum(steady: Steady) -> tuple[Floats, Floats]:
    """Return frequency and amplitude (gal) of the forward acceleration on the incline."""
    _, signal = on_incline(steady)
    lines = 2.0 * np.abs(np.fft.rfft(signal - signal.mean())) / len(signal) * GAL
    hz: Floats = np.asarray(np.fft.rfftfreq(len(signal), 1.0 / RATE_HZ), dtype=np.float64)
    return hz, lines


def accelerations(steady: Steady, machine: MultibodyMachine) -> Iterator[Figure]:
    """Yield the lines of the forward acceleration."""
    subject = f"spectrum of a step's forward acceleration ({PUBLISHED})"
    hz, gal = spectrum(steady)
    pitch_hz = machine.experiment.speed_m_s / machine.chain.pitch_m
    for k, published in enumerate(PUBLISHED_HZ, start=1):
        near = np.abs(hz - k * pitch_hz) < 0.06
        name = f'{published} Hz of the paper, {k} x speed over pitch'
        yield Figure(subject, f'{name}: frequency', k * pitch_hz, 'Hz',
                     1.01 * published, 0.99 * published)  # fmt: skip
        yield Figure(subject, f'{name}: amplitude', float(gal[near].max()), 'gal')
    low = hz < 5.0
    yield Figure(subject, 'largest line below 5 Hz at', float(hz[low][gal[low].argmax()]), 'Hz')
    yield Figure(subject, 'largest line at', float(hz[gal.argmax()]), 'Hz')
    _, signal = on_incline(steady)
    slow = np.fft.rfft(signal - signal.mean())
    slow[hz > 5.0] = 0.0
    wave = np.fft.irfft(slow, len(signal))
    yield Figure(subject, 'largest below 5 Hz', GAL * float(np.abs(wave).max()), 'gal')
    yield Figure(subject, 'root mean square, all', GAL * float(signal.std()), 'gal')


def costs(machine: MultibodyMachine, steady: Steady) -> Iterator[Figure]:
    """Yield real-time factors on one core."""
    subject = "cost, by one core's own time"
    yield Figure(subject, 'steps and handrail: real-time factor', steady.factor, '', least=1.0)
    alone = build(machine, ('steps',))
    alone.rest(3.0)
    best = 0.0
    for _ in range(4):
        begun = time.thread_time()
        alone.advance(1.0, RATE_HZ, np.zeros((0, 3), np.int64), 1.0)
        best = max(best, 1.0 / (time.thread_time() - begun))
    yield Figure(subject, 'steps alone: real-time factor', best, '', least=5.0)


def larger(name: str, each_ns: float) -> Iterator[Figure]:
    """Yield steady running and cost of a larger machine."""
    machine = load_kind(name)
    simulation = build(machine)
    begin = 0.1 * simulation.path.length_m
    simulation.start(begin)
    steady = record(simulation, 8 * machine.chain.pitch_m / machine.experiment.speed_m_s)
    subject = f'{machine.name}: {simulation.counts.line()}'
    yield from speeds(steady, machine, subject)
    half = len(steady.time_s) // 2
    torque = steady.columns['torque']
    drift = 100.0 * (torque[half:].mean() / torque[:half].mean() - 1.0)
    yield Figure(subject, 'torque, second half of the record over the first, less 1', drift, '%')
    ratio = steady.body_ns / each_ns
    yield Figure(subject, 'cost per body over that of the machine of 4.5 m', ratio, '', 1.3)


def load_kind(name: str) -> MultibodyMachine:
    """Return a machine of free bodies by its file's name."""
    machine: Machine = load_machine(machines_folder() / f'{name}.yaml')
    assert isinstance(machine, MultibodyMachine)
    return machine


def pictures(started: Steady, steady: Steady, folder: Path) -> None:
    """Draw what the paper's figures 4 to 8 show of a simulation."""
    machine = steady.simulation.machine
    assert machine.handrail is not None
    begun, run = started.columns, steady.columns
    at, length = started.time_s, steady.simulation.path.length_m
    order = np.argsort(run['place'])
    hz, gal = spectrum(steady)
    seen = hz < 15.0
    incline_s, incline = on_incline(steady)
    drawings = {
        'speed': ('Speeds from start-up (as figure 4)', 'time, s', 'mm/s', [
            Line('a step', at, 1e3 * begun['step_speed']),
            Line('handrail', at, 1e3 * begun['rail_speed'])]),
        'acceleration': ('Forward acceleration of a step on the incline (as figure 5)', 'time, s',
                         'gal', [Line('simulated', incline_s, GAL * (incline - incline.mean()))]),
        'spectrum': ("Its lines; 1.22, 2.44 and 3.66 Hz are the paper's", 'frequency, Hz', 'gal', [
            Line('simulated', hz[seen], gal[seen]),
            *(Line(f'{f} Hz', np.array([f, f]), np.array([0.0, gal[seen].max()]))
              for f in PUBLISHED_HZ)]),
        'reaction': ('Reaction of a chain roller over the loop (as figure 6)', 'place, m', 'N', [
            Line('simulated', run['place'][order], run['reaction'][order])]),
        'tension': ('Tension of a link over the loop (as figure 7)', 'place, m', 'N', [
            Line('simulated', run['place'][order], run['tension'][order]),
            rope_line(machine, length)]),
        'torque': ('Torque at the motor from start-up (as figure 8)', 'time, s', 'N m', [
            Line('step part', at, smooth(begun['torque'] * machine.drive.gear_ratio)),
            Line('handrail part', at, smooth(begun['pulley'] * machine.handrail.gear_ratio))]),
    }  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    for name, (title, x, y, lines) in drawings.items():
        (folder / f'kwon_{name}.svg').write_text(svg(title, x, y, lines), encoding='utf-8')


def rope_line(machine: MultibodyMachine, length_m: float) -> Line:
    """Return the rope's tension where no gear holds the chain."""
    rope = step_rope(machine, machine.default_experiment())
    s = np.linspace(0.0, length_m, 600)
    return Line('rope by hand', s, rope.at(s))


def smooth(values: Floats) -> Floats:
    """Return a running mean over a tenth of a second."""
    width = round(0.1 * RATE_HZ)
    return np.convolve(np.pad(values, (width // 2, width - 1 - width // 2), 'edge'),
                       np.full(width, 1.0 / width), 'valid')  # fmt: skip


def figures(folder: Path | None = None, with_larger: bool = True) -> Iterator[Figure]:
    """Yield all figures; with a folder, draw the pictures into it."""
    machine = load_kind('kwon')
    yield from counts(machine)
    simulation = build(machine)
    simulation.rest(1.0)
    started = record(simulation, START_UP_S, machine.drive.start_up_s)
    steady = record(simulation, whole_pitches(machine))
    yield from speeds(steady, machine, 'steady speeds')
    yield from accelerations(steady, machine)
    yield from tensions(steady, machine)
    yield from costs(machine, steady)
    if folder is not None:
        pictures(started, steady, folder)
    if with_larger:
        for name in LARGER:
            yield from larger(name, steady.body_ns)


def main() -> int:
    """Print every figure beside its bar; return 1 where one does not hold."""
    status, subject = 0, ''
    for figure in figures(Path(sys.argv[1]) if len(sys.argv) > 1 else None):
        if figure.subject != subject:
            subject = figure.subject
            print(f'\n{subject}')
        print(figure.line(), flush=True)
        status |= not figure.holds
    return int(status)


if __name__ == '__main__':
    sys.exit(main())
