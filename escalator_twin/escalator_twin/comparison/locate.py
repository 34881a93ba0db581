"""From a recording alone: clocks, real speed and the place in the loop where it begins."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.case import BESIDE
from escalator_twin.check.clock import ClockComparison
from escalator_twin.check.quality import quality
from escalator_twin.comparison.assign import mend_by_model, turn_by_waves
from escalator_twin.comparison.clocks import logger_clocks
from escalator_twin.comparison.direction import require_direction, tells_little
from escalator_twin.comparison.exchanged import exchanged
from escalator_twin.comparison.mend import mend
from escalator_twin.comparison.outliers import bridge_left
from escalator_twin.comparison.standstill import without_standstill
from escalator_twin.errors import RecordingError, SynchronisationError
from escalator_twin.machine import Machine
from escalator_twin.metrics.filters import lowpass
from escalator_twin.physics.course import course_of
from escalator_twin.signals import Experiment, Finding, Floats, Recording
from escalator_twin.sync.ground import scan_shift
from escalator_twin.sync.place import clear_lead, find_place, Place
from escalator_twin.sync.speed import estimate_speed, SpeedEstimate
from escalator_twin.sync.template import make_template, Template, Templates
from escalator_twin.sync.timeline import Clock, origin_ns, time_all, Timed
from escalator_twin.sync.travel import BAND_HZ, Fit, fit_travel, Ground, Guess, HELD, Travel
from escalator_twin.twin import make_simulation, run_twin

RATE_HZ = 200.0  # of simulated records
MARGIN_M = 0.2  # simulated beyond one loop, so that its end can be interpolated
LEAD_S = 1.0  # simulated before and after the recording, for filters and fit
EDGE_S = 1.0  # of the recording left out in the search, for the low-pass
WANDER = 0.002  # of the speed where the machine's description gives none
# Best for speed first: what stands still beside the chain repeats with every pitch, what rides on it with every loop.
QUANTITIES = ('carriage_displacement', 'gear_torque', 'link_force', 'step_acceleration')
UNKNOWN_SD_S = 2.0  # of the shift between two loggers' clocks that no bag time ties together
FREE = Ground(shift_sd_s=0.05, rate_sd=1e-3)  # once the scan has found the nearest pitch period


@dataclass(frozen=True)
class Setting:
    """Where and how fast a recording ran: all that the twin must be told to run beside it.

    Attributes
    ----------
    experiment : Experiment
        ``set_speed_m_s`` is the real mean speed.
    origin_ns : int
        Time zero of the reference clock.
    clocks : mapping of logger to Clock
        By bag time; the reference logger's is neutral.
    comparisons : mapping of logger to ClockComparison
        Of the loggers beside the reference.
    tracks : mapping of channel to Timed
        Measured channels in reference time.
    start_s_m : float
        Path coordinate of axle 0 when the twin's run begins, ``LEAD_S`` before the first sample.
    duration_s : float
        Of the twin's run.
    ground : Ground
        How the reference's samples were moved where bag time does not tie the loggers.
    travel : Travel
        Over reference time; 0 where the twin's run begins.
    lead : float
        Log-likelihood by which the place beats the best one at another pitch.
    findings : tuple of Finding
    """

    experiment: Experiment
    origin_ns: int
    clocks: Mapping[str, Clock]
    comparisons: Mapping[str, ClockComparison]
    tracks: Mapping[str, Timed]
    start_s_m: float
    duration_s: float
    ground: Ground
    travel: Travel
    lead: float
    findings: tuple[Finding, ...]

    @property
    def is_certain(self) -> bool:
        """Whether the recording cannot be a pitch or more away from where it was placed."""
        return self.lead >= self.least_lead

    @property
    def least_lead(self) -> float:
        """The lead by which its place is certain."""
        return clear_lead(self.duration_s - 2.0 * LEAD_S)


MakeLoop = Callable[[Machine, Experiment], Template]


def locate(
    recording: Recording,
    machine: Machine,
    template: Template | None = None,
    make_loop: MakeLoop | None = None,
) -> Setting:
    """Find clocks, speed and loop position of a recording.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    template : Template, optional
        One loop of the twin in this experiment; simulated where it is not given.
    make_loop : callable, optional
        Simulates that loop, at the speed found; it may leave channels out.

    Raises
    ------
    RecordingError
        Without experiment settings or samples.
    SynchronisationError
        Where speed or place cannot be known, or the machine ran the other way.
    """
    begun = _begin(recording, machine)
    recording, findings, origin = begun.recording, begun.findings, begun.origin_ns
    clocks, comparisons, tracks, speed = begun.clocks, begun.comparisons, begun.tracks, begun.speed
    assert recording.experiment is not None
    experiment = replace(recording.experiment, set_speed_m_s=speed.value)
    is_new = template is None
    if template is None:
        template = (make_loop or simulate_loop)(machine, experiment)
    low = {c: lowpass(t.values, BAND_HZ, t.rate_hz) for c, t in tracks.items()}
    place = _first_place(tracks, low, template, speed, recording.path, machine.chain.pitch_m)
    if is_new and tells_little(place, machine):
        back = replace(experiment, direction=-experiment.direction)
        loop = (make_loop or simulate_loop)(machine, back)
        way = _first_place(tracks, low, loop, speed, recording.path, machine.chain.pitch_m)
        require_direction(recording, machine, place, way)
    end = max(float(t.time_s[-1]) for t in tracks.values())
    # a travelling logger whose clock nothing ties may seem to have begun long before the origin
    first_s = min(0.0, *(float(t.time_s[0]) for t in tracks.values()))
    margin = 2.0 * machine.chain.pitch_m
    templates = template.tiled(
        place.start_m + 1.02 * speed.high * first_s - margin,
        place.start_m + 1.02 * speed.high * end + margin,
        speed.value,
    )
    is_tied = all(c.is_known for c in comparisons.values())
    try:
        tracks, wrong = mend_by_model(
            tracks, low, templates, speed.value, place.start_m, machine, is_tied
        )
    except RecordingError as error:
        raise RecordingError(f'{recording.path}: {error}') from error
    guess = Guess(speed.value, place.start_m, machine.drive.speed_wander or WANDER)
    fit = fit_all(tracks, templates, guess, machine, comparisons)
    tracks, turned = turn_by_waves(tracks, templates, fit.travel, machine)
    bridged, findings = bridge_left(tracks, templates, fit.travel, findings, exchanged(wrong))
    is_bridged = any(bridged[c] is not track for c, track in tracks.items())
    tracks = bridged
    if turned or is_bridged:
        fit = fit_all(tracks, templates, guess, machine, comparisons)
    real = fit.travel.speed_m_s
    begin = float(fit.travel.at(np.array([first_s]))[0]) - real * LEAD_S
    length = course_of(machine).length_m
    return Setting(
        replace(experiment, set_speed_m_s=real),
        origin,
        clocks,
        comparisons,
        tracks,
        template.place_at(begin, experiment.direction, length),
        end - first_s + 2.0 * LEAD_S,
        fit.ground,
        fit.travel.shifted(-begin),
        place.lead,
        (*findings, *wrong, *turned),
    )


def checked(recording: Recording, machine: Machine) -> Experiment:
    """Return what was set for a recording that can be placed, as far as that shows without the twin.

    Raises
    ------
    RecordingError, SynchronisationError
        As `locate`.
    """
    experiment = _begin(recording, machine).recording.experiment
    assert experiment is not None
    return experiment


@dataclass(frozen=True)
class _Begun:
    """A recording whose clocks and speed are known."""

    recording: Recording
    findings: list[Finding]
    origin_ns: int
    clocks: Mapping[str, Clock]
    comparisons: Mapping[str, ClockComparison]
    tracks: dict[str, Timed]
    speed: SpeedEstimate


def _begin(recording: Recording, machine: Machine) -> _Begun:
    """Find clocks and speed."""
    findings = quality(recording, machine)
    recording, findings = mend(recording, machine, findings)
    recording, left_out = without_standstill(recording, machine)
    findings = [*findings, *left_out]
    if recording.experiment is None:
        raise RecordingError(
            f'{recording.path}: no message on the experiment topic: direction, set speed, load '
            f'and preload are not known; {BESIDE} in its directory may tell them'
        )
    origin = origin_ns(recording, machine)
    clocks, comparisons = logger_clocks(recording, machine)
    tracks = time_all(recording, machine, clocks, origin)
    speed = _speed(tracks, machine, recording)
    return _Begun(recording, findings, origin, clocks, comparisons, tracks, speed)


def fit_all(
    tracks: Mapping[str, Timed],
    templates: Templates,
    guess: Guess,
    machine: Machine,
    comparisons: Mapping[str, ClockComparison],
) -> Fit:
    """Fit travel to all channels, the reference's clock as free as bag time leaves it.

    Where bag time does not tie the loggers, the travelling logger's channels are fitted first,
    then the reference's are shifted to where they agree best, then all are fitted together.
    """
    ground = machine.instruments.channels_of(machine.instruments.reference_logger)
    fixed = {c: t for c, t in tracks.items() if c in ground}
    riding = {c: t for c, t in tracks.items() if c not in ground}
    prior = HELD
    if riding and fixed and not all(c.is_known for c in comparisons.values()):
        alone = fit_travel(riding, templates, guess)
        guess = replace(guess, travel=alone.travel)
        shift = scan_shift(fixed, templates, alone.travel, UNKNOWN_SD_S)
        prior = replace(FREE, shift_s=shift)
    return fit_travel(tracks, templates, guess, ground, prior)


def simulate_loop(machine: Machine, experiment: Experiment) -> Template:
    """Simulate one loop from path coordinate 0 at constant speed."""
    loop = machine.chain.n_links * machine.chain.pitch_m
    simulation = make_simulation(machine, experiment)
    duration = (loop + MARGIN_M) / experiment.set_speed_m_s
    sensors = machine.instruments.sensors
    trace = run_twin(simulation, sensors, 0.0, duration, RATE_HZ)
    travel = trace.time_s * experiment.set_speed_m_s
    channels = tuple(s.channel for s in sensors)
    return make_template(channels, trace.columns, trace.place_m, travel, loop)


def _speed(tracks: Mapping[str, Timed], machine: Machine, recording: Recording) -> SpeedEstimate:
    """Estimate the mean speed from the first channel that tells it, the carriage's first."""
    assert recording.experiment is not None
    order = sorted(
        (s for s in machine.instruments.sensors if s.channel in tracks),
        key=lambda s: QUANTITIES.index(s.quantity) if s.quantity in QUANTITIES else 9,
    )
    reasons = []
    for sensor in order:
        track = tracks[sensor.channel]
        try:
            return estimate_speed(
                track.time_s,
                np.where(track.valid, track.values, np.nan),
                machine.chain.pitch_m,
                recording.experiment.set_speed_m_s,
                machine.drive.speed_error,
                machine.drive.speed_wander or WANDER,
                machine.chain.n_links * machine.chain.pitch_m,
            )
        except SynchronisationError as error:
            reasons.append(f'{sensor.channel}: {error}')
    raise SynchronisationError(f'{recording.path}: speed: ' + '; '.join(reasons))


def _first_place(
    tracks: Mapping[str, Timed],
    low: Mapping[str, Floats],
    template: Template,
    speed: SpeedEstimate,
    path: str,
    pitch_m: float,
) -> Place:
    """Find the template's travel at reference time 0, to within the template's spacing."""
    measured, first = {}, {}
    for channel, track in tracks.items():
        keep = slice(round(EDGE_S * track.rate_hz), -round(EDGE_S * track.rate_hz))
        time, values = track.time_s[keep], low[channel][keep]
        if len(time) < 2:
            raise SynchronisationError(
                f'{path}: {channel}: too short: {len(track.time_s)} samples'
            )
        travel = speed.value * time
        grid = np.arange(travel[0], travel[-1], template.spacing_m)
        measured[channel] = np.interp(grid, travel, values)
        first[channel] = travel[0]
    loop = dict(zip(template.channels, template.values.T, strict=True))
    start = min(first.values())
    shifted = {
        c: np.roll(loop[c], -round((first[c] - start) / template.spacing_m))
        for c in measured
        if c in loop
    }
    place = find_place(measured, shifted, template.spacing_m, pitch_m)
    return replace(place, start_m=place.start_m - start)
