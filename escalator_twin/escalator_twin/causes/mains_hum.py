r"""A mains tone on the gauges of some links.

Law
---
Every gauge of the links reads

.. math:: \varepsilon + a \sin(2 \pi f t + \varphi)

more, a = ``strain``, f = ``frequency_hz``: 50 or 60 Hz, or what a harmonic of them folds to at
the logger's rate f_s, |k f_s - h f|. Sampling folds the tone by itself.

Limits
------
One steady tone; a real mains frequency wanders by some 0.1 %.

Alike
-----
None: no part of the machine has that frequency at every speed.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.imperfections import Imperfections, Tone
from escalator_twin.causes.phases import PHASE
from escalator_twin.causes.places import find_channel, GAUGED_LINKS, items
from escalator_twin.machine import Machine


def alter_imperfections(
    imperfections: Imperfections, machine: Machine, location: Location, theta: Theta
) -> Imperfections:
    """Return ``imperfections`` with a tone on all gauges of some links."""
    if theta['strain'] == 0.0:
        return imperfections
    for name in items(location, 'links'):
        channel = find_channel(machine, str(name))
        sensor, errors = machine.instruments.sensor(channel), imperfections.sensors[channel]
        amplitude = theta['strain'] * sensor.sign * sensor.scale
        tone = Tone(amplitude, theta['frequency_hz'], theta['phase_rad'])
        imperfections = imperfections.with_sensor(
            channel, replace(errors, tones=(*errors.tones, tone))
        )
    return imperfections


CAUSE = Cause(
    name='mains_hum',
    law='a mains tone on gauges',
    parameters=(
        Parameter('strain', 'm/m', 0.0, 1e-3, neutral=0.0, tolerance=1e-7),
        Parameter('frequency_hz', 'Hz', 1.0, 1000.0),
        PHASE,
    ),
    places=(GAUGED_LINKS,),
    references=(
        {'strain': 6e-6, 'frequency_hz': 50.0},
        {'strain': 6e-6, 'frequency_hz': 60.0},
    ),
    acts_on=('link_force',),
    locked_to=('time',),
    alter_imperfections=alter_imperfections,
)
