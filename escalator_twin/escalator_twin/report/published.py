"""What the published validation of such a twin reached: the figures beside ours.

J. L. Cano-Moreno et al., "Experimental validation of an escalator simulation model": means over
its recordings, section V; speeds, section IV.
"""

from collections.abc import Callable
from dataclasses import dataclass

from escalator_twin.report.documents import Json, number, table


@dataclass(frozen=True)
class Figure:
    """One published figure.

    Attributes
    ----------
    quantity : str
    told : str
        As published.
    channels : callable
        Tells whether a channel belongs to it.
    key : str
        Metric; empty for the speed.
    """

    quantity: str
    told: str
    channels: Callable[[str], bool]
    key: str
    is_percent: bool = False


def _force(channel: str) -> bool:
    return channel.startswith('link_force/')


def _acceleration(channel: str) -> bool:
    return '/acceleration/' in channel


def _tensioner(channel: str) -> bool:
    return channel.startswith('tensioner/')


FIGURES = (
    Figure('chain force, r in time, 2 Hz', 'over 0.85', _force, 'r_time'),
    Figure('chain force, r of spectra', 'over 0.99', _force, 'r_freq'),
    Figure('step acceleration, r in time, 2 Hz', '0.60', _acceleration, 'r_time'),
    Figure('step acceleration, r in time, 0.2 Hz', '0.80', _acceleration, 'r_time_slow'),
    Figure('step acceleration, r of spectra', 'over 0.90', _acceleration, 'r_freq'),
    Figure('tensioner, r in time', '0.75', _tensioner, 'r_time'),
    Figure('tensioner, r of spectra', '8 % above that in time', _tensioner, 'r_freq'),
)
SPEED = Figure('set against real speed', 'below 7 %', lambda _: False, '', True)


def values(figure: Figure, recording: Json) -> dict[str, float | None]:
    """Return a figure's values in one recording, by channel."""
    return {
        channel: number(table(scores).get(figure.key))
        for channel, scores in table(recording.get('channels')).items()
        if figure.channels(channel)
    }


def speed_error(recording: Json) -> float | None:
    """Return the relative difference of real and set speed."""
    real = number(table(recording.get('speed_m_s')).get('value'))
    wanted = number(recording.get('set_speed_m_s'))
    return real / wanted - 1.0 if real is not None and wanted else None
