"""From motion to a bag: instruments with their errors, clocks, faults, messages."""

from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from scipy.signal import butter, sosfiltfilt

from belt.chain import Chain, numeric, ROW_S
from belt.rope import balance

NS, EPOCH_NS, VERSION = 10**9, 1_790_000_000 * 10**9, 9
EVERY = 5  # rows of a sample: 200 Hz
EA_N = 1.34e8
DEFINITIONS = {
    'escalator_msgs/msg/Experiment': 'std_msgs/Header header\nstring machine\nstring case_id\n'
    'float64 set_speed\nint8 direction\nfloat64 load_per_step\nfloat64 preload\nstring notes\n',
    'escalator_msgs/msg/LinkStrain': 'std_msgs/Header header\nstring link\nfloat64[4] strain\n',
    'escalator_msgs/msg/LinkForce': 'std_msgs/Header header\nstring link\nfloat64 force\n',
    'escalator_msgs/msg/RollerForce': 'std_msgs/Header header\nint32 axle\nstring side\n'
    'float64 s\nfloat64 normal_force\n',
    'escalator_msgs/msg/TensionerDisplacement': 'std_msgs/Header header\nfloat64 displacement\n',
}
FAULTS = ('gauge_gain', 'gauge_drift', 'gauge_dead', 'accelerometer_misalignment', 'axis_inverted',
          'data_gap', 'sensor_spikes', 'mains_hum')  # fmt: skip
GAP_FROM_S = 6.0  # of a hidden gap; its length is the fault's size
GAIN = 0.005  # of reaction, torque and handrail tension, one standard deviation
THERMAL = 2e-6  # strain: the largest drift of a gauge


def measure(chain, rows, rng, faults):
    """Return what the instruments read at 200 Hz, by name."""
    low = butter(4, 80.0, fs=1.0 / ROW_S, output='sos')
    seen = sosfiltfilt(low, rows, axis=0)[::EVERY]
    felt = sosfiltfilt(low, chain.specific_force(rows), axis=0)[::EVERY]
    n = len(seen)
    turn = np.radians(faults.get('accelerometer_misalignment', rng.normal(0.0, 0.3)))
    c, s = np.cos(turn), np.sin(turn)
    felt = np.stack([c * felt[:, 0] - s * felt[:, 1], s * felt[:, 0] + c * felt[:, 1]], axis=1)
    felt = felt + rng.uniform(-0.05, 0.05, 2) + rng.normal(0.0, 0.005, (n, 2))
    if 'axis_inverted' in faults:
        felt[:, 0] *= -1.0
    gain = faults.get('gauge_gain', 1.0) * (1.0 + rng.normal(0.0, 0.003))
    strain = gain * seen[:, 3:4] / EA_N + rng.uniform(-1e-4, 1e-4, 4)
    strain = strain + faults.get('gauge_drift', 0.0) * np.linspace(0.0, 1.0, n)[:, None]
    part = np.linspace(0.0, 1.0, n)[:, None]
    strain = strain + THERMAL * rng.uniform(-0.5, 0.5, 4) * part
    strain = strain + THERMAL * rng.uniform(-0.25, 0.25, 4) * np.cos(2.0 * np.pi * part)
    if 'mains_hum' in faults:
        tone = 2.0 * np.pi * 50.0 * np.arange(n) * EVERY * ROW_S
        strain = strain + faults['mains_hum'] * np.sin(tone + rng.uniform(0.0, 6.0))[:, None]
    strain = strain + rng.normal(0.0, 0.25e-6, (n, 4))
    if 'gauge_dead' in faults:
        strain[:, int(faults['gauge_dead']) - 1] = strain[0, int(faults['gauge_dead']) - 1]
    read = {
        'acceleration': felt,
        'strain': strain,
        'reaction': scaled(seen[:, 4], rng) + rng.uniform(-20.0, 20.0) + rng.normal(0.0, 2.0, n),
        'displacement': seen[:, 2] + rng.uniform(-5e-3, 5e-3) + rng.normal(0.0, 2e-5, n),
        'torque': scaled(seen[:, 5], rng) + rng.uniform(-5.0, 5.0) + rng.normal(0.0, 2.0, n),
    }
    if 'sensor_spikes' in faults:
        where = rng.choice(np.arange(200, n - 200, 40), int(faults['sensor_spikes']), False)
        read['torque'][where] += 800.0 * rng.choice([-1.0, 1.0], len(where))
    if chain.sheet.get('handrail'):
        pull, _ = balance(chain.sheet, chain.hidden.get('handrail_drag', 0.0))
        rail = numeric(chain.sheet['handrail']['speed_m_s']) * chain.speed / 0.5
        pull = scaled(pull, rng) + rng.uniform(-10.0, 10.0)
        read['rail_tension'] = pull + rng.normal(0.0, 2.0, n)
        read['rail_speed'] = rail + rng.normal(0.0, 0.002, n)
    return read


def scaled(values, rng):
    """Return values as a sensor with a wrong gain, within its tolerance, reads them."""
    return (1.0 + rng.normal(0.0, GAIN)) * values


def write(path, sheet, read, set_speed_m_s, rng, gap_s=0.0):
    """Write readings as a rosbag2 directory; the on-board logger has a clock of its own."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    kinds = store.types
    offset, drift = rng.uniform(-2.0, 2.0), rng.uniform(-50e-6, 50e-6)

    def header(ns, frame):
        stamp = kinds['builtin_interfaces/msg/Time'](sec=ns // NS, nanosec=ns % NS)
        return kinds['std_msgs/msg/Header'](stamp=stamp, frame_id=frame)

    vector = kinds['geometry_msgs/msg/Vector3']
    zero = vector(x=0.0, y=0.0, z=0.0)
    upright = kinds['geometry_msgs/msg/Quaternion'](x=0.0, y=0.0, z=0.0, w=1.0)
    none = np.zeros(9)

    def make(kind, **fields):
        return lambda h: store.serialize_cdr(kinds[kind](header=h, **fields), kind)

    def imu(v):
        felt = vector(x=float(v[0]), y=0.0, z=float(v[1]))
        return make(
            'sensor_msgs/msg/Imu', orientation=upright, orientation_covariance=none,
            angular_velocity=zero, angular_velocity_covariance=none, linear_acceleration=felt,
            linear_acceleration_covariance=none,
        )  # fmt: skip

    def wrench(v):
        force = kinds['geometry_msgs/msg/Wrench'](
            force=zero, torque=vector(x=0.0, y=float(v), z=0.0)
        )
        return make('geometry_msgs/msg/WrenchStamped', wrench=force)

    def twist(v):
        speed = kinds['geometry_msgs/msg/Twist'](
            linear=vector(x=float(v), y=0.0, z=0.0), angular=zero
        )
        return make('geometry_msgs/msg/TwistStamped', twist=speed)

    package = 'escalator_msgs/msg/'
    topics = {  # name -> topic, type, on board, message of a value
        'acceleration': ('step/acceleration', 'sensor_msgs/msg/Imu', True, imu),
        'reaction': ('roller/reaction', package + 'RollerForce', True, lambda v: make(
            package + 'RollerForce', axle=0, side='', s=0.0, normal_force=float(v))),
        'strain': ('chain/tension', package + 'LinkStrain', True, lambda v: make(
            package + 'LinkStrain', link='tension', strain=v)),
        'displacement': (
            'tensioner/displacement', package + 'TensionerDisplacement', False,
            lambda v: make(package + 'TensionerDisplacement', displacement=float(v))),
        'torque': ('gear/torque', 'geometry_msgs/msg/WrenchStamped', False, wrench),
        'rail_tension': ('handrail/tension', package + 'LinkForce', False, lambda v: make(
            package + 'LinkForce', link='handrail', force=float(v))),
        'rail_speed': ('handrail/speed', 'geometry_msgs/msg/TwistStamped', False, twist),
    }  # fmt: skip
    messages = []
    topics = {name: row for name, row in topics.items() if name in read}
    for name, (topic, kind, on_board, make_one) in topics.items():
        for i, value in enumerate(read[name]):
            true = i * EVERY * ROW_S
            if gap_s and name == 'torque' and GAP_FROM_S <= true < GAP_FROM_S + gap_s:
                continue
            own = offset + true * (1.0 + drift) if on_board else true
            late = 4e-3 + abs(rng.normal(0.0, 1e-3))
            ns = EPOCH_NS + round(own * NS)
            bag = EPOCH_NS + round((true + late) * NS)
            messages.append((bag, topic, kind, ns, make_one(value)))
    kind = package + 'Experiment'
    first = store.serialize_cdr(
        kinds[kind](
            header=header(EPOCH_NS, ''), machine=sheet['name'], case_id='belt',
            set_speed=set_speed_m_s, direction=1, load_per_step=0.0,
            preload=numeric(sheet['experiment']['preload_n']), notes='',
        ),
        kind,
    )  # fmt: skip
    with Writer(Path(path), version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        known = {
            'experiment': writer.add_connection('/measured/experiment', kind, typestore=store)
        }
        writer.write(known['experiment'], EPOCH_NS - 10**6, bytes(first))
        for topic, kind, _, _ in topics.values():
            known[topic] = writer.add_connection(f'/measured/{topic}', kind, typestore=store)
        for bag, topic, _, ns, one in sorted(messages, key=lambda m: m[0]):
            writer.write(known[topic], bag, bytes(one(header(ns, topic))))


def make_recording(path, sheet, start_m, duration_s, seed, hidden=None, speed_m_s=0.5):
    """Drive the chain with what is hidden in it and write what its instruments read."""
    rng = np.random.default_rng(seed)
    hidden = dict(hidden or {})
    faults = {name: hidden.pop(name) for name in FAULTS if name in hidden}
    chain = Chain(sheet, hidden, speed_m_s)
    rows = chain.drive(start_m, duration_s)
    read = measure(chain, rows, rng, faults)
    write(path, sheet, read, 0.5, rng, faults.get('data_gap', 0.0))
    return rows
