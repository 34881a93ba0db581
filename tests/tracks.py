"""A small machine's track, and signals on it whose every part is known."""

import numpy as np

from escalator_twin.metrics import machine_orders, Track

PITCH = 0.405
N_LINKS = 12
LOOP = N_LINKS * PITCH
RATE = 100.0
SPEED = 0.45


def make_track(n_loops=2.3, speed=SPEED, wander=0.0, rate=RATE):
    """Return a track that holds ``n_loops`` inside its margins, and its time."""
    n = int((n_loops * LOOP / speed + 4.0) * rate) + 2
    time = np.arange(n) / rate
    travel = speed * (time + wander * 5.0 * np.sin(time / 5.0))
    return Track(travel, rate, LOOP, PITCH, machine_orders(N_LINKS, PITCH, 0.075)), time


def wave(track, amplitude, order, phase=0.0):
    return amplitude * np.cos(2 * np.pi * order * track.travel_m / PITCH + phase)


def slow(track):
    """A large loop-locked signal, as a link force has."""
    return 5000.0 + wave(track, 1000.0, 1 / N_LINKS) + wave(track, 100.0, 2 / N_LINKS, 1.0)
