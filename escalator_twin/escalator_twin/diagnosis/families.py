"""All families of causes: who looks for what."""

from escalator_twin.diagnosis.search import Family
from escalator_twin.diagnosis.search_gauges import gains
from escalator_twin.diagnosis.search_more import drive_waves, frame_bounce
from escalator_twin.diagnosis.search_places import drags, indexed, loads
from escalator_twin.diagnosis.search_rails import rail_steps
from escalator_twin.diagnosis.search_treads import eccentric, flats
from escalator_twin.diagnosis.search_whole import far, stops, tolerances, whole

# What takes longest begins first: several look at a time.
FAMILIES: tuple[Family, ...] = (
    frame_bounce, drive_waves, eccentric, gains, indexed, loads, drags, whole, tolerances, far,
    stops,
)  # fmt: skip
COSTLY: tuple[Family, ...] = (flats, rail_steps)
