"""A comparator whose diagnosis takes seconds: what is tested is the way to it and back.

The stand-in takes the place of `pipeline.diagnose`; what it answers depends on its arguments.
"""

from functools import partial
from pathlib import Path
import sys
import time

import yaml

from escalator_twin.errors import EscalatorError
from escalator_twin.pipeline import compare

STEPS = 4
SIDE = 'left'
WHEN = ('before', 'after')
# any effect that shows
DEVIATION = {
    'cause': 'tensioner_stiffness',
    'location': {},
    'parameters': {'factor': 0.5},
}


def diagnose(paths, machine_path, seed=0, jobs=1, progress=None, out=None):
    """Compare, and name what the seed says, in the form of `pipeline.diagnose`."""
    if seed == 2:
        raise EscalatorError(f'{paths[0]}: the stand-in\n refuses')
    if seed == 3:
        sys.exit(7)
    document = compare(paths, machine_path)
    for done in range(STEPS if seed != 4 else 10**6):
        progress(done, STEPS if seed != 4 else 10**6)
        time.sleep(0.05)
    description = {'extends': str(Path(machine_path).absolute()), 'deviations': [DEVIATION]}
    Path(out).write_text(yaml.safe_dump(description))
    scores = dict.fromkeys(
        [f'{name}_{when}' for name in ('nrmse', 'r_time', 'nrmse_band') for when in WHEN], 0.25
    ) | {'chi2_before': 400.0, 'chi2_after': None}
    return {
        'schema': 'escalator_twin/diagnosis/1',
        'machine': machine_path,
        'recordings': document['recordings'],
        'effects': [
            {
                **DEVIATION,
                'parameters': {'factor': {'value': 0.5, 'low': 0.4, 'high': 0.6}},
                'probability': 0.9,
                'alternatives': ['chain_elongation'],
            },
            {
                'cause': 'gauge_gain',
                'location': {'link': 'left_a'},
                'parameters': {},
                'probability': 0.6,
                'alternatives': [],
            },
        ],
        'candidates': [
            {'cause': 'roller_drag', 'location': {'axle': 4, 'side': SIDE}, 'probability': 0.1},
        ],
        'unexplained': {
            'significant': True,
            'share': 0.2,
            'signature': {
                'channels': {'chain/pull': 1.0},
                'locked_to': ['travel'],
                'frequencies_hz': [1.5, 2.0],
                'cycles_per_pitch': [1.0, 1.2],
                'largest_at_s_m': 0.7,
            },
        },
        'extended_machine': str(out),
        'gain': {
            'held_out': {'split': 'blocks', 'blocks': 12, 'channels': {'chain/pull': scores}}
        },
        'jobs': jobs,
    }


def main():
    from escalator_twin.ros.comparator_node import ComparatorNode, NAME
    from escalator_twin.ros.spin import run

    return run(partial(ComparatorNode, diagnose), NAME)


if __name__ == '__main__':
    sys.exit(main())
