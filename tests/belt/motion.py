"""Beads on a curve: the chain of the steps, integrated by classical Runge-Kutta."""

from math import pi

from numba import njit
import numpy as np

SUB_S = 1e-4
FREE_N_S_M = (
    2.0e3  # of a roller between two rails: it crosses their play in hundredths of a second
)
EASE_M = 0.05
STRETCH_M = 0.5  # of the neighbours of the lower gear that move with it, less and less


@njit(cache=True, nogil=True, error_model='numpy')
def read(table, length, s, row):
    """Fill a row from a table over the closed curve."""
    n = table.shape[0] - 1
    place = (s % length) * n / length
    i = min(int(place), n - 1)
    part = place - i
    for k in range(table.shape[1]):
        row[k] = table[i, k] * (1.0 - part) + table[i + 1, k] * part


@njit(cache=True, nogil=True, error_model='numpy')
def rates(y, t, table, number, drags, lengths, out, seen):
    """Fill the rates of y = [s, v, u, u', gear angle, e]; e is how far rollers are off their curve.

    A tread without mass yields to what links and weight press, by the law of a sphere. Columns of
    ``table``: x, z, cos, sin, bend, height's slope, share that moves with the lower gear and its
    slope, support that weights ask of the chain's roller and of the trailing one, offset of the
    lower face and of the upper one, and their stiffnesses (N/m^1.5).
    ``number`` holds the machine's numbers in the order of `Chain._numbers`.
    """
    n = drags.shape[0]
    length, mass, k, c = number[0], number[1], number[2], number[3]
    weight, resist, fixed, creep = number[4], number[5], number[6], number[7]
    idle, heavy = number[8], number[9]
    begin, gear, radius, arc, omega = number[10], number[11], number[12], number[13], number[14]
    m_u, k_u, c_u, push, dry, ramp = (
        number[15],
        number[16],
        number[17],
        number[18],
        number[19],
        number[20],
    )
    eccentric, phase, seats_n_m = number[21], number[22], number[23]
    loss, loss_s_m = number[24], number[25]
    u, du, turned = y[2 * n], y[2 * n + 1], y[2 * n + 2]
    share = 0.5 * (1.0 - np.cos(pi * t / ramp)) if t < ramp else 1.0
    px, pz, tx, tz = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    wx, wz, rise, turning = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    row = np.empty((n, table.shape[1]))
    for i in range(n):
        read(table, length, y[i], row[i])
        off_line = y[2 * n + 3 + i]
        px[i] = row[i, 0] - u * row[i, 6] - off_line * row[i, 3]
        pz[i] = row[i, 1] + off_line * row[i, 2]
        tx[i] = (1.0 - off_line * row[i, 4]) * row[i, 2] - u * row[i, 7]
        tz[i] = (1.0 - off_line * row[i, 4]) * row[i, 3]
        way = (y[i] % length) - begin
        if eccentric != 0.0 and 0.0 <= way < gear:
            # the rim's circle turns about a shaft that is off its centre: the bead rides on it
            angle = way / radius - turned + phase
            inside = min(way, gear - way)
            ease = 1.0 if inside > EASE_M else inside / EASE_M
            eased = 0.0
            if inside <= EASE_M:
                eased = 1.0 / EASE_M if way < gear - way else -1.0 / EASE_M
            apart, along = eccentric * np.cos(angle), eccentric * np.sin(angle)
            rise[i] = eased * apart - ease * along / radius
            turning[i] = ease * along
            px[i] -= ease * apart * row[i, 3]
            pz[i] += ease * apart * row[i, 2]
            stretch = ease * apart * row[i, 4]
            tx[i] -= stretch * row[i, 2] + rise[i] * row[i, 3]
            tz[i] -= stretch * row[i, 3] - rise[i] * row[i, 2]
            wx[i] = -turning[i] * share * omega * row[i, 3]
            wz[i] = turning[i] * share * omega * row[i, 2]
    fx, fz = np.zeros(n), np.zeros(n)
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        dx, dz = px[j] - px[i], pz[j] - pz[i]
        d = np.sqrt(dx * dx + dz * dz)
        ex, ez = dx / d, dz / d
        rate = (y[n + j] * tx[j] - du * row[j, 6] - y[n + i] * tx[i] + du * row[i, 6]) * ex
        rate += (y[n + j] * tz[j] - y[n + i] * tz[i]) * ez
        rate += (wx[j] - wx[i]) * ex + (wz[j] - wz[i]) * ez
        pull = k * (d - lengths[i]) + c * rate
        seen[i] = pull
        fx[i] += pull * ex
        fz[i] += pull * ez
        fx[j] -= pull * ex
        fz[j] -= pull * ez
    torque, along, carried = 0.0, 0.0, m_u
    for i in range(n):
        v = y[n + i]
        force = fx[i] * tx[i] + fz[i] * tz[i] - weight * (row[i, 5] + rise[i] * row[i, 2])
        across = fz[i] * row[i, 2] - fx[i] * row[i, 3]
        normal = row[i, 8] - across + heavy * row[i, 4] * v * v
        seen[n + i] = normal
        pressed = 0.0
        if y[2 * n + 3 + i] < row[i, 10]:
            pressed = row[i, 12] * (row[i, 10] - y[2 * n + 3 + i]) ** 1.5
        elif y[2 * n + 3 + i] > row[i, 11]:
            pressed = -row[i, 13] * (y[2 * n + 3 + i] - row[i, 11]) ** 1.5
        out[2 * n + 3 + i] = (pressed - normal) / (FREE_N_S_M + loss_s_m * abs(pressed))
        way = (y[i] % length) - begin
        grip, still = 0.0, 0.0
        if 0.0 <= way < gear:
            angle = way / radius - turned + phase
            off = way - turned * radius + eccentric * np.sin(angle)
            off -= arc * np.floor(off / arc + 0.5)
            inside = min(way, gear - way)
            ease = 1.0 if inside > EASE_M else inside / EASE_M
            seat = seats_n_m * np.sqrt(abs(off)) * off
            # eq. (6): the loss follows the speed at which the seat is pressed
            lost = np.tanh(loss_s_m / loss * (v - share * omega * radius))
            grip = -ease * (seat + loss * abs(seat) * lost)
            torque += grip * radius + normal * turning[i]
            # a roller in its seat turns with gear and step: it does not roll, nor do its seals rub
            normal, still = 0.0, idle
        load = abs(normal) + row[i, 9]
        drag = (resist * load + fixed - still + drags[i]) * np.tanh(v / creep)
        out[i] = v
        out[n + i] = (force - drag + grip) / mass
        # what rides on the lower gear moves with it: m (dv tx - du' share + v^2 bend nx) along x
        moved = row[i, 6]
        along += (fx[i] - tx[i] * (force - drag + grip)) * moved
        along += mass * moved * row[i, 4] * row[i, 3] * v * v
        carried += mass * moved * moved * (1.0 - tx[i] * tx[i])
    out[2 * n] = du
    net = push - k_u * u - c_u * du - dry * np.tanh(du / 2e-3) - along
    out[2 * n + 1] = net / carried
    for i in range(n):
        out[n + i] += row[i, 6] * tx[i] * out[2 * n + 1]
    out[2 * n + 2] = share * omega
    seen[2 * n] = torque


@njit(cache=True, nogil=True, error_model='numpy')
def run(y, table, number, drags, lengths, n_rows, n_sub, h, t0):
    """Integrate; return rows of s, v, u, link 0, normal of roller 0, torque, means of a row."""
    n = drags.shape[0]
    a, b, c, d = np.empty_like(y), np.empty_like(y), np.empty_like(y), np.empty_like(y)
    seen = np.empty(2 * n + 1)
    record = np.zeros((n_rows, 6))
    t = t0
    for row in range(n_rows):
        for _ in range(n_sub):
            rates(y, t, table, number, drags, lengths, a, seen)
            record[row, 3] += seen[0] / n_sub
            record[row, 4] += seen[n] / n_sub
            record[row, 5] += seen[2 * n] / n_sub
            rates(y + 0.5 * h * a, t + 0.5 * h, table, number, drags, lengths, b, seen)
            rates(y + 0.5 * h * b, t + 0.5 * h, table, number, drags, lengths, c, seen)
            rates(y + h * c, t + h, table, number, drags, lengths, d, seen)
            y += h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            t += h
        record[row, 0], record[row, 1], record[row, 2] = y[0], y[n], y[2 * n]
    return record
