"""Small documents of the three verbs, made of known waves, for the tests of the page."""

import numpy as np

N = 400
PITCH_M, SPEED_M_S, RATE_HZ = 0.4, 0.5, 20.0
CHANNELS = ('link_force/left_a', 'tensioner/displacement', 'step/acceleration/x')


def overlay_columns(scale, gap=False):
    time = np.arange(N) / RATE_HZ
    travel = SPEED_M_S * time + 0.01 * np.sin(time)
    wave = scale * np.sin(2 * np.pi * travel / PITCH_M)
    measured = [float(v) for v in 1.1 * wave]
    if gap:
        measured[100:140] = [None] * 40
    return {
        'time_s': time.tolist(),
        'travel_m': travel.tolist(),
        'place_m': ((3.7 - travel) % 4.0).tolist(),
        'measured': measured,
        'simulated': wave.tolist(),
    }


def scores(r_time=0.9876, ripple_r=0.8):
    order = {'cycles_per_pitch': 1.0, 'amplitude_ratio': 0.909, 'phase_deg': -3.2}
    return {
        'r_time': r_time,
        'r_freq': 0.9912,
        'nrmse': 0.123,
        'lag_s': -0.0042,
        'ceiling_r_time': 0.9991,
        'ceiling_share': 0.8,
        'ripple_r': ripple_r,
        'ripple_nrmse': 0.31,
        'ripple_ceiling': 0.95,
        'orders': [{**order, 'coherence': 0.98}],
    }


def recording(case_id='low_up_empty_lo', path='/bags/one', **changes):
    channels = {name: scores() for name in CHANNELS}
    found = {
        'path': path,
        'case_id': case_id,
        'direction': 1,
        'set_speed_m_s': 0.5,
        'speed_m_s': {'value': 0.48765, 'low': 0.4875, 'high': 0.4878},
        'start_s_m': 3.7026,
        'clock': {'offset_s': 0.6031, 'drift_ppm': 21.8},
        'channels': channels,
        'quality': [],
        'overlay': {
            'band_hz': 8.0,
            'channels': {
                name: overlay_columns(1000.0 / 10**i, gap=i == 0)
                for i, name in enumerate(CHANNELS)
            },
        },
    }
    return {**found, **changes}


def comparison(*recordings):
    return {
        'schema': 'escalator_twin/compare/1',
        'machine': 'config/machines/prototype.yaml',
        'recordings': list(recordings) or [recording()],
    }


def campaign():
    """Return a full plan of four factors; load adds 0.2 to the scatter, speed takes 0.1 off."""
    scatter = np.random.default_rng(5)
    found = []
    for i in range(16):
        high, down, full, hi = ((i >> bit) & 1 for bit in (3, 2, 1, 0))
        name = '_'.join(
            (
                f'{i + 1:02d}',
                'high' if high else 'low',
                'down' if down else 'up',
                'full' if full else 'empty',
                'hi' if hi else 'lo',
            )
        )
        part = recording(
            name,
            f'/bags/{i}',
            direction=-1 if down else 1,
            set_speed_m_s=0.5 if high else 0.25,
            overlay={},
        )
        for channel in part['channels'].values():
            channel['nrmse'] = 0.3 + 0.2 * full - 0.1 * high + 0.002 * scatter.standard_normal()
        found.append(part)
    return comparison(*found)


def diagnosis(*recordings):
    gain = {
        'nrmse_before': 0.12,
        'nrmse_after': 0.024,
        'r_time_before': 0.993,
        'r_time_after': 0.9998,
        'nrmse_band_before': 0.14,
        'nrmse_band_after': 0.031,
        'chi2_before': 412.0,
        'chi2_after': 22.3,
    }
    return {
        'schema': 'escalator_twin/diagnosis/1',
        'machine': 'config/machines/prototype.yaml',
        'recordings': list(recordings) or [recording()],
        'effects': [
            {
                'cause': 'roller_drag',
                'location': {'axle': 44, 'side': 'left'},
                'parameters': {'force_N': {'value': 118.4, 'low': 112.9, 'high': 123.8}},
                'probability': 0.973,
                'alternatives': ['guide_drag'],
            }
        ],
        'candidates': [
            {
                'cause': 'roller_drag',
                'location': {'axle': 44, 'side': 'left'},
                'probability': 0.973,
                'evidence': {'for': ['once per loop'], 'against': ['silent in link b']},
            },
            {
                'cause': 'guide_step',
                'location': {'s_m': 13.27, 'side': 'both'},
                'probability': 0.02,
            },
        ],
        'unexplained': {'significant': True, 'share': 0.034, 'signature': {'locked_to': 'guide'}},
        'extended_machine': 'out/extended.yaml',
        'gain': {
            'held_out': {
                'split': 'later passages',
                'blocks': 12,
                'channels': dict.fromkeys(CHANNELS, gain),
            }
        },
    }


def joint_diagnosis():
    """Return a diagnosis of two recordings: what the pipeline adds to the contract's keys."""
    first, second = recording(), recording('high_down_full_hi', '/bags/two', direction=-1)
    told = diagnosis(first, second)
    alone = {key: told[key] for key in ('effects', 'candidates', 'unexplained')}
    held_out = told['gain']['held_out'] | {
        'gain_interval': [0.894, 0.925],
        'significant': True,
        'worse': [CHANNELS[2]],
    }
    quiet = {'significant': False, 'share': 0.0, 'signature': {}}
    return told | {
        'gain': {'held_out': held_out},
        'extended_machine_yaml': 'extends: prototype.yaml\ndeviations:\n- cause: roller_drag\n',
        'by_recording': [
            {'path': '/bags/one', **alone, 'gain': held_out},
            {
                'path': '/bags/two',
                'effects': [],
                'candidates': [],
                'unexplained': quiet,
                'gain': None,
            },
        ],
    }


def check():
    return {
        'schema': 'escalator_twin/check/1',
        'path': '/bags/one',
        'case_id': 'low_up_empty_lo',
        'experiment': {'load_per_step_kg': [75.0], 'preload_n': 3000.0, 'notes': ''},
        'topics': [
            {'topic': '/measured/a', 'type': 'x/msg/A', 'found': True, 'rate_hz': 199.99},
            {'topic': '/measured/b', 'type': 'x/msg/B', 'found': False, 'channels': ['b/c']},
        ],
        'clock': {
            'logger': 'on_board',
            'reference': 'ground',
            'offset_s': -0.9372,
            'offset_low_s': -0.9373,
            'offset_high_s': -0.9371,
            'drift_ppm': 20.7,
        },
        'quality': [
            {
                'kind': 'data_gap',
                'channel': 'link_force/left_a',
                'from_s': 40.0,
                'to_s': 44.0,
                'detail': '4.00 s without samples',
                'repaired': False,
            }
        ],
    }
