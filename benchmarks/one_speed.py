"""``python -m benchmarks.one_speed``: how often one recording can tell a law of speed at all.

At one speed v a ``friction_speed`` multiplies rolling resistance by 1 + rise exp(-v / v0), and so does a good
machine's own factor, which is normal about 1 by its tolerance. Whoever names where the product is beyond some
tolerances, names a good machine as often as its own factor is. Closed form; nothing of the package is used.
"""

from collections.abc import Sequence
from math import exp

from scipy.stats import norm

# contracts.md: the reference, the tolerance of `rolling_resistance`, an effect's least; issue 6: the most good
# machines that may be named. And the prototype's two speeds.
RISE, SPEED_M_S, TOLERANCE = 1.2, 0.2, 0.1
EFFECT, NAMED_ON_CLEAN, BAR = 3.0, 0.02, 0.6
SPEEDS_M_S = (0.25, 0.5)


def named(speed_m_s: float, tolerances: float, rise: float = RISE) -> float:
    """Return the share of machines with a law of speed that look beyond some tolerances at one speed."""
    grown = 1.0 + rise * exp(-speed_m_s / SPEED_M_S)
    return float(norm.sf((1.0 + tolerances * TOLERANCE) / grown, 1.0, TOLERANCE))


def lines_of(speeds_m_s: Sequence[float] = SPEEDS_M_S) -> list[str]:
    """Return one row a threshold: named of good machines, at each speed, over all speeds."""
    rows = []
    for tolerances in (EFFECT, float(norm.isf(NAMED_ON_CLEAN))):
        shares = [named(v, tolerances) for v in speeds_m_s]
        every = sum(shares) / len(shares)
        cells = [
            f'{tolerances:.2f} tolerances',
            *(f'{100.0 * s:.1f} %' for s in (float(norm.sf(tolerances)), *shares, every)),
        ]
        rows.append(f'| {" | ".join(cells)} |')
    return rows


def main() -> int:
    """Print the rows."""
    head = ['named beyond', 'of good machines', *(f'at {v:g} m/s' for v in SPEEDS_M_S), 'of both']
    print(f'| {" | ".join(head)} |')
    print('|' + '---|' * len(head))
    for line in lines_of():
        print(line)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
