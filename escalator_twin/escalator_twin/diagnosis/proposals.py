"""What a search proposes: a cause, where it may sit, about how large, and what it explains."""

from dataclasses import dataclass, field

from escalator_twin.machine import Deviation


@dataclass(frozen=True)
class Proposal:
    """A cause at a place with its linear estimate.

    Attributes
    ----------
    cause : str
    location : mapping
    parameters : mapping of name to float
    gain : float
        By how much chi squared falls, by the linear estimate.
    sd : mapping of parameter to float
        Standard deviations by the same estimate.
    places : int
        Among how many places of the cause this one was chosen.
    fitted : tuple of str
        Parameters that a refinement fits, the one that sizes the effect first.
    """

    cause: str
    location: dict[str, object]
    parameters: dict[str, float]
    gain: float
    sd: dict[str, float] = field(default_factory=dict)
    places: int = 1
    fitted: tuple[str, ...] = ()
    nuisance: str | None = None

    @property
    def deviation(self) -> Deviation:
        """The proposal as part of a machine description."""
        return Deviation(self.cause, dict(self.parameters), dict(self.location))
