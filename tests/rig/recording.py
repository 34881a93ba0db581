"""From a machine and its instruments to a recording."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.bagfile import IMU, Recording, Series
from rig.instruments import (
    ACCELERATION_STEP,
    bag_times,
    EPOCH_NS,
    GROUND_HZ,
    Instruments,
    link_strains,
    LINKS,
    ONBOARD_HZ,
    PACKET_NS,
    quantise,
    REFLEX_NOISE,
    REFLEX_STEP,
    sample_acceleration,
    sample_strains,
    specific_force,
    stamps,
    STRAIN_STEP,
)
from rig.model import RECORD
from rig.run import ROW_S
from rig.sheet import Sheet

FloatArray = NDArray[np.float64]

PACKET_PLACE = {'left_a': 0, 'left_b': 1, 'right_a': 2, 'right_b': 3, 'acceleration': 5}


@dataclass(frozen=True)
class Signals:
    """What the instruments saw, before their resolution: the place of the sensor's faults.

    Attributes
    ----------
    onboard_s, ground_s : true times of the samples (s).
    strain : (4 links, n, 4 gauges) m/m.
    acceleration : (n, 3) m/s2.
    displacement : (n_ground,) m.
    keep : per channel name, which samples are recorded.
    """

    onboard_s: FloatArray
    ground_s: FloatArray
    strain: FloatArray
    acceleration: FloatArray
    displacement: FloatArray
    keep: dict[str, NDArray[np.bool_]]


def sample(rows: FloatArray, kit: Instruments, sheet: Sheet, rng: np.random.Generator) -> Signals:
    """Sample the true signals, ``ROW_S`` apart, as both loggers do; each with its own phase."""
    onboard_every = round(1.0 / (ONBOARD_HZ * ROW_S))
    ground_every = round(1.0 / (GROUND_HZ * ROW_S))
    onboard = np.arange(int(rng.integers(onboard_every)), rows.shape[0], onboard_every)
    ground = np.arange(int(rng.integers(ground_every)), rows.shape[0], ground_every)
    time_s = onboard * ROW_S
    strain = sample_strains(link_strains(rows, sheet)[:, onboard], time_s, kit, rng)
    displacement = rows[ground, RECORD.index('u')] + kit.reflex_zero_m
    displacement = displacement + rng.normal(0.0, REFLEX_NOISE, ground.size)
    return Signals(
        onboard_s=time_s,
        ground_s=ground * ROW_S,
        strain=strain,
        acceleration=sample_acceleration(specific_force(rows, sheet)[onboard], kit, rng),
        displacement=displacement,
        keep={},
    )


def record(
    signals: Signals, kit: Instruments, rng: np.random.Generator, header: Recording
) -> Recording:
    """Round to resolution, stamp, and bring the messages to the recorder."""
    packet = bag_times(signals.onboard_s, kit, rng)
    stamp = stamps(signals.onboard_s, kit.clock_offset_s, kit.clock_drift)
    series = []
    for k, link in enumerate(LINKS):
        series.append(
            kept(
                Series(
                    f'/measured/link/{link}/strain',
                    'escalator_msgs/msg/LinkStrain',
                    f'link_{link}',
                    stamp,
                    packet + PACKET_PLACE[link] * PACKET_NS,
                    quantise(signals.strain[k], STRAIN_STEP),
                ),
                signals.keep.get(f'link_force/{link}'),
            )
        )
    series.append(
        kept(
            Series(
                '/measured/step/acceleration',
                IMU,
                'step_0',
                stamp,
                packet + PACKET_PLACE['acceleration'] * PACKET_NS,
                quantise(signals.acceleration, ACCELERATION_STEP),
            ),
            signals.keep.get('step/acceleration'),
        )
    )
    series.append(
        kept(
            Series(
                '/measured/tensioner/displacement',
                'escalator_msgs/msg/TensionerDisplacement',
                'tensioner',
                stamps(signals.ground_s, 0.0, 0.0),
                bag_times(signals.ground_s, kit, rng),
                quantise(signals.displacement, REFLEX_STEP)[:, None],
            ),
            signals.keep.get('tensioner/displacement'),
        )
    )
    return replace(header, start_ns=EPOCH_NS, series=tuple(series))


def kept(series: Series, mask: NDArray[np.bool_] | None) -> Series:
    """Leave out the samples that were lost."""
    if mask is None:
        return series
    return replace(
        series,
        stamp_ns=series.stamp_ns[mask],
        bag_ns=series.bag_ns[mask],
        values=series.values[mask],
    )
