"""What the compiled kernels read: one flat record of numbers and arrays per machine."""

from collections import namedtuple

# Arrays over axle ends or links have shape (2, links): left, right.  Tables run around the
# loop on the design path coordinate, ``cells`` entries.  SI units throughout.
Model = namedtuple(
    'Model',
    [
        # guide
        'seg_start',
        'seg_x',
        'seg_z',
        'seg_heading',
        'seg_cos',
        'seg_sin',
        'seg_curvature',
        'seg_design',
        'seg_scale',
        'loop',
        'cell',
        'normal',
        'normal_slope',
        'lateral',
        'lateral_slope',
        'half_play',
        'stretch_drag',
        'support',
        # chain
        'pitch',
        'mass',
        'link_k',
        'link_c',
        'rest',
        'rest_rate',  # 1/s, of every link's length as the chain warms
        'rack_k',
        'rack_c',
        'bend',
        # rollers
        'contact_k',
        'contact_c',
        'resistance',
        'resistance_rate',  # 1/s, of the resistance as its grease warms
        'roll_speed',
        'viscous',
        'extra_drag',
        'seizing',  # N/s, by which a roller's drag grows
        'radius',
        'ecc',
        'ecc_phase',
        'flat',
        'flat_phase',
        'flat_angle',
        # drive
        'drive_from',
        'drive_to',
        'drive_ramp',
        'drive_k',
        'drive_c',
        'speed',
        'direction',
        'wander',
        'wander_step',
        'ripple',
        'ripple_per_m',
        'ripple_phase',
        'hunting',
        'hunting_hz',
        'hunting_phase',
        'slip_force',
        'rack_dogs',
        'bad_dog',
        'bad_dog_m',
        # tensioner
        'carriage_mass',
        'tens_k',
        'tens_c',
        'tens_k3',
        'preload',
        'preload_rate',
        'dry',
        'dry_speed',
        'stop',
        'stop_k',
        'stop_c',
        # load
        'load',
        'load_from',
        'load_to',
        'load_ramp',
        'swing',
        'swing_hz',
        'boarding_s',
        'boarding',  # -, of the load, from then on
        # lateral
        'lat_k',
        'lat_c',
        'lat_mass',
        'gravity',
        # frame mode
        'mode_x',
        'mode_z',
        'mode_mass',
        'mode_k',
        'mode_c',
        'mode_carried',  # N: the weight with which the frame was surveyed
        # how the data sheet is read, see READINGS
        'reading',
        # timed disturbances
        'blow_force',
        'blow_period',
        'blow_width',
        'shake_force',
        'shake_hz',
        'rub_force',
        'rub_from',
        'rub_to',
        'rub_period',
        'rub_on',
    ],
)

RECORD = (
    'rack',
    'u',
    'u_rate',
    'force_left_a',
    'force_left_b',
    'force_right_a',
    'force_right_b',
    'ax',
    'ay',
    'az',
    'angle',
    's_left',
    's_right',
    'mode',
    'roll',
    'n_left_0',
    'n_left_1',
    'n_left_30',
    'n_left_31',
    'n_right_0',
    'n_right_1',
    'n_right_30',
    'n_right_31',
    'dog',  # largest pull of any dog
)

# Readings of the data sheet that the recordings decided; 1 as adopted, 0 for the other one.
READINGS = (
    'drag_on_carriage',  # rolling drag on the lower turnaround reacts on the carriage
    'moving_line',  # the contact's damper sees the rail line move under the roller
    'tread_on_both',  # a high tread takes play from both tracks, else it shifts the centre
    'net_normal',  # a pinched roller resists by its net normal force, else by both contacts'
)
