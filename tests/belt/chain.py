"""The numbers of the chain, with what is hidden in them, and its motion."""

from math import pi
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
import yaml

from belt.curve import step_curves
from belt.motion import run, STRETCH_M, SUB_S

ROW_S = 1e-3
RAMP_S, SETTLE_S = 1.5, 3.0
CAUSES = ('rolling_resistance', 'roller_drag', 'chain_elongation', 'tensioner_preload',
          'tensioner_friction', 'gear_eccentricity', 'handrail_drag')  # fmt: skip


def read_sheet(path):
    """Return a description as it stands, tolerances dropped."""

    def plain(value):
        if isinstance(value, dict):
            if set(value) == {'value', 'tol'}:
                return float(value['value'])
            return {k: plain(v) for k, v in value.items()}
        return [plain(v) for v in value] if isinstance(value, list) else value

    return plain(yaml.safe_load(Path(path).read_text(encoding='utf-8')))


def numeric(value):
    """Return a number, also where YAML read it as text."""
    return float(value)


class Chain:
    """Curves and numbers; ``hidden`` maps causes of ``CAUSES`` to their sizes."""

    def __init__(self, sheet, hidden=None, speed_m_s=0.5):
        self.sheet, self.hidden, self.speed = sheet, dict(hidden or {}), speed_m_s
        self.curve, self.trailing = step_curves(sheet)
        self.n, self.pitch = int(sheet['chain']['n_links']), numeric(sheet['chain']['pitch_m'])
        self._bodies()
        self._numbers()

    def _bodies(self):
        """Tabulate where step and trailing rollers are for every place of the axle."""
        curve, trailing = self.curve, self.trailing
        step = self.sheet['step']
        grid = np.linspace(0.0, curve.length, len(curve.x))
        own = np.linspace(0.0, trailing.length, len(trailing.x))
        wheelbase = numeric(step['wheelbase_m'])
        back = grid - wheelbase
        for _ in range(40):
            bx, bz = (np.interp(back, own, v, period=trailing.length) for v in
                      (trailing.x[:], trailing.z[:]))  # fmt: skip
            away = np.hypot(curve.x - bx, curve.z - bz)
            back = back + np.clip(away - wheelbase, -0.1, 0.1)
        angle = np.unwrap(np.arctan2(curve.z - bz, curve.x - bx))
        behind, below = numeric(step['centre_behind_m']), numeric(step['centre_below_m'])
        cx = curve.x - behind * np.cos(angle) + below * np.sin(angle)
        cz = curve.z - behind * np.sin(angle) - below * np.cos(angle)
        self.grid = grid
        self.step_x, self.step_z = CubicSpline(grid, cx), CubicSpline(grid, cz)
        self.angle = CubicSpline(grid, angle)
        roller = self.sheet['roller']
        self.masses = (
            numeric(self.sheet['chain']['mass_per_pitch_kg']), numeric(step['mass_kg']),
            2.0 * numeric(roller['mass_kg']) + numeric(roller['trailing_extra_kg']),
        )  # fmt: skip
        height = self.masses[0] * curve.z + self.masses[1] * cz + self.masses[2] * bz
        self.height_slope = np.gradient(height, grid) / sum(self.masses)
        heading = np.interp(back % trailing.length, own, trailing.heading)
        self._supports((cx, cz), (bx, bz), heading)

    def _supports(self, centre, behind, heading):
        """Tabulate what weights ask of both rails: the step in balance about its axle."""
        x, z, g = self.curve.x, self.curve.z, numeric(self.sheet['gravity_m_s2'])
        arm = behind[0] - x, behind[1] - z
        nx, nz = -np.sin(heading), np.cos(heading)
        tips = self.masses[1] * g * (centre[0] - x) + self.masses[2] * g * arm[0]
        push = tips / (arm[0] * nz - arm[1] * nx)
        a = self.curve.heading
        down = sum(self.masses) * g - push * nz
        self.on_chain = down * np.cos(a) + push * nx * np.sin(a)
        self.on_trailing = np.abs(push)

    def _numbers(self):
        """Collect what the equations of motion read; see `motion.rates`."""
        sheet, hidden, curve = self.sheet, self.hidden, self.curve
        chain, roller, tensioner = sheet['chain'], sheet['roller'], sheet['tensioner']
        drive, g = sheet['drive'], numeric(sheet['gravity_m_s2'])
        moves = np.zeros_like(self.grid)
        gear_from = curve.ends[8]
        moves[self.grid >= gear_from] = 1.0
        before = (self.grid > gear_from - STRETCH_M) & (self.grid < gear_from)
        moves[before] = (self.grid[before] - gear_from + STRETCH_M) / STRETCH_M
        after = self.grid < STRETCH_M
        moves[after] = 1.0 - self.grid[after] / STRETCH_M
        slope = np.gradient(moves, self.grid)
        self.table = np.column_stack([
            curve.x, curve.z, np.cos(curve.heading), np.sin(curve.heading), curve.bend,
            self.height_slope, moves, slope, self.on_chain, self.on_trailing, *self._faces(),
        ])  # fmt: skip
        total, step = sum(self.masses), self.masses[1]
        spin = 4 * 0.5 * numeric(roller['mass_kg'])
        radius = numeric(sheet['guide']['turnaround_radius_m'])
        seats = int(drive['seats'])
        resist = numeric(roller['rolling_resistance']) * hidden.get('rolling_resistance', 1.0)
        fixed = 4.0 * (
            numeric(roller['seal_drag_n']) + numeric(roller['viscous_drag_n_s_m']) * self.speed
        )
        kept = numeric(sheet['contact']['gear']['restitution']) ** 2
        loss, slow_m_s = (
            (1.0 - kept) / (1.0 + kept),
            numeric(sheet['contact']['gear']['normal_speed_m_s']),
        )
        self.number = np.array([
            curve.length, total + spin, 2.0 * numeric(chain['link_stiffness_n_m']),
            2.0 * numeric(chain['link_damping_n_s_m']), total * g, resist, fixed,
            numeric(roller['creep_speed_m_s']), 0.5 * fixed, self.masses[0] + 0.5 * step,
            curve.ends[5], curve.ends[6] - curve.ends[5],
            radius, 2.0 * pi * radius / seats, 2.0 * pi * self.speed / (seats * self.pitch),
            numeric(tensioner['mass_kg']), numeric(tensioner['stiffness_n_m']),
            numeric(tensioner['damping_n_s_m']),
            numeric(sheet['experiment']['preload_n']) * hidden.get('tensioner_preload', 1.0),
            numeric(tensioner['dry_friction_n']) + hidden.get('tensioner_friction', 0.0), RAMP_S,
            hidden.get('gear_eccentricity', 0.0), hidden.get('gear_phase', 0.0),
            2.0 * 0.733 * numeric(sheet['contact']['gear']['elastic_modulus_pa'])
            * (0.5 * numeric(roller['diameter_m'])) ** 0.5, loss, 2.5 * loss / slow_m_s,
        ])  # fmt: skip
        self.drags = np.zeros(self.n)
        self.drags[int(hidden.get('roller_drag_axle', 0))] = hidden.get('roller_drag', 0.0)
        self.lengths = np.full(self.n, self.pitch + hidden.get('chain_elongation', 0.0))

    def _faces(self):
        """Return offsets of both faces from the curve, m, and eq. (5) of both, two rollers each.

        The play of the channel is above the roller, but below it where the return run is straight;
        a gear has no upper face.
        """
        curve, sheet = self.curve, self.sheet
        play = numeric(sheet['guide']['channel_clearance_m'])
        radius = 0.5 * numeric(sheet['roller']['diameter_m'])
        piece = np.clip(np.searchsorted(curve.ends, self.grid, side='right') - 1, 0, 8)
        part = (self.grid - np.array(curve.ends)[piece]) / np.diff(curve.ends)[piece]
        low = np.where(piece == 6, -play * part, 0.0)
        low = np.where(piece == 7, -play * (1.0 - part), low)
        high = np.where(piece == 5, 1.0, low + play)
        high = np.where(piece == 8, 1.0, high)
        modulus = numeric(sheet['contact']['tread']['elastic_modulus_pa'])
        # of the faces themselves, a roller's radius off the curve of its centre; a right turn bulges
        below = -curve.bend / (1.0 + curve.bend * radius)
        above = curve.bend / (1.0 - curve.bend * radius)
        stiff = [2.0 * 0.733 * modulus / np.sqrt(np.maximum(1.0 / radius + bulge, 1e-3))
                 for bulge in (below, above)]  # fmt: skip
        return low, high, *stiff

    def begin(self, start_m):
        """Return the state with axle 0 at a place, at rest, links about as long as they are."""
        x, z, grid = self.curve.x, self.curve.z, self.grid
        s = np.empty(self.n + 1)
        s[0] = start_m
        for i in range(self.n):
            ahead = s[i] + self.pitch
            here = [np.interp(s[i] % self.curve.length, grid, v) for v in (x, z)]
            for _ in range(30):
                there = [np.interp(ahead % self.curve.length, grid, v) for v in (x, z)]
                ahead += self.pitch - float(np.hypot(there[0] - here[0], there[1] - here[1]))
            s[i + 1] = ahead
        s = start_m + (s[:-1] - start_m) * self.curve.length / (s[-1] - start_m)
        y = np.zeros(3 * self.n + 3)
        y[: self.n] = s
        way = (s - self.number[10]) % self.curve.length
        middle = way[np.argmin(np.abs(way - 0.5 * self.number[11]))]
        y[2 * self.n + 2] = middle / self.number[12]
        return y

    def drive(self, start_m, duration_s):
        """Return rows a millisecond apart: s, v, u, link 0, reaction of roller 0, torque."""
        lead = self.speed * (0.5 * RAMP_S + SETTLE_S)
        y = self.begin((start_m - lead) % self.curve.length)
        sub = round(ROW_S / SUB_S)
        number = (self.table, self.number, self.drags, self.lengths)
        run(y, *number, round((RAMP_S + SETTLE_S) / ROW_S), sub, SUB_S, 0.0)
        return run(y, *number, round(duration_s / ROW_S), sub, SUB_S, RAMP_S + SETTLE_S)

    def specific_force(self, rows):
        """Return what an accelerometer on step 0 feels, forward and up, m/s2."""
        s, v = rows[:, 0] % self.curve.length, rows[:, 1]
        gained = np.gradient(v, ROW_S)
        x, z, a = self.step_x, self.step_z, self.angle(s)
        ax = x(s, 1) * gained + x(s, 2) * v * v
        az = z(s, 1) * gained + z(s, 2) * v * v + numeric(self.sheet['gravity_m_s2'])
        return np.stack([ax * np.cos(a) + az * np.sin(a), az * np.cos(a) - ax * np.sin(a)], axis=1)
