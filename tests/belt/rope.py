"""The handrail as a rope in balance at constant speed."""

import numpy as np

from belt.curve import handrail_curve

ROUNDS = 40


def balance(sheet, drag_n=0.0):
    """Return tension where the return incline begins, N, and the driving pulley's torque, N m."""
    curve, h = handrail_curve(sheet), sheet['handrail']
    n = len(curve.x) - 1
    ds = curve.length / n
    weight = float(h['mass_per_m_kg']) * float(sheet['gravity_m_s2'])
    piece = np.searchsorted(curve.ends, (np.arange(n) + 0.5) * ds) - 1
    friction = np.where(np.isin(piece, (5, 6, 8, 10, 11)), float(h['roll']['friction']),
                        float(h['slide']['friction']))  # fmt: skip
    bent = 2.0 * float(h['bending_drag_n_m']) * np.abs(curve.bend[:-1])
    bent /= np.diff(curve.ends)[piece]
    driven = piece == 7
    order = np.roll(np.arange(n), -int(np.flatnonzero(driven)[-1]) - 1)
    slack = float(h['tension_n'])
    for _ in range(ROUNDS):
        tension = np.zeros(n)
        pull = slack
        for i in order:
            if driven[i]:
                break
            support = abs(weight * np.cos(curve.heading[i]) - curve.bend[i] * pull)
            pull += ds * (weight * np.sin(curve.heading[i]) + friction[i] * support + bent[i]
                          + drag_n / curve.length)  # fmt: skip
            tension[i] = pull
        slack += float(h['tension_n']) - tension[~driven].mean()
    rise = weight * ds * float(np.sin(curve.heading[:-1][driven]).sum())
    rest = float((bent[driven] * ds).sum() + drag_n * driven.mean())
    torque = (pull - slack + rise + rest) * float(h['pulley_radius_m'])
    return float(tension[int(curve.ends[9] / ds) + 1]), torque
