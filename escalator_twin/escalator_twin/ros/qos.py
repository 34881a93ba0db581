"""Every quality of service of the nodes, named once."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

# KEEP_LAST drops what it overwrites, RELIABLE or not: the depth is what carries a stall.
SAMPLE_DEPTH = 2000

SAMPLES = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=SAMPLE_DEPTH,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# what is wrong with a recording: all of it for who comes later
FINDINGS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=200,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# results that come now and then, and commands
EVENTS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
# reliable: whoever subscribes to a clock, best effort as rclpy or not, is served
CLOCK = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
VIEWS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=2,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)


def samples_like(reliability: str, durability: str) -> QoSProfile:
    """Return the profile of samples with the policies that a recording names.

    Parameters
    ----------
    reliability : str
        ``best_effort``; anything else is reliable.
    durability : str
        ``transient_local``; anything else is volatile.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=SAMPLE_DEPTH,
        reliability=ReliabilityPolicy.BEST_EFFORT
        if reliability == 'best_effort'
        else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if durability == 'transient_local'
        else DurabilityPolicy.VOLATILE,
    )
