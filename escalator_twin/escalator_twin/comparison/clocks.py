import numpy as np

from escalator_twin.sync.timeline import Clock


def logger_clocks(recording, machine):
    lines = {}
    t0 = min(int(s.bag_ns[0]) for s in recording.signals.values())
    for name in machine.instruments.loggers:
        ch = [c for c in machine.instruments.channels_of(name) if c in recording.signals]
        if not ch:
            continue
        s = recording.signals[sorted(ch)[0]]
        t = (s.bag_ns - t0) * 1e-9
        d = (s.stamp_ns - s.bag_ns) * 1e-9
        lines[name] = np.polyfit(t, d, 1)
    ref = lines.get(machine.instruments.reference_logger, np.zeros(2))
    return {n: Clock(float(c[1] - ref[1]), float(c[0] - ref[0])) for n, c in lines.items()}, True
