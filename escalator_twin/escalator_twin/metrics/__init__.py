"""Scores of a simulated signal against a measured one; live and offline use the same code."""

from escalator_twin.metrics.bands import Bands, Pair, split_bands
from escalator_twin.metrics.channel import score_channel
from escalator_twin.metrics.orders import order_scores, OrderScore
from escalator_twin.metrics.pose import remove_sensor_pose
from escalator_twin.metrics.registry import CONTRACT, Metric, METRICS, QUICK, Score, score
from escalator_twin.metrics.sides import side_scores, SideScore
from escalator_twin.metrics.track import machine_orders, Track

__all__ = [
    'CONTRACT',
    'METRICS',
    'QUICK',
    'Bands',
    'Metric',
    'OrderScore',
    'Pair',
    'Score',
    'SideScore',
    'Track',
    'machine_orders',
    'order_scores',
    'remove_sensor_pose',
    'score',
    'score_channel',
    'side_scores',
    'split_bands',
]
