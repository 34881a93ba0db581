"""Which channels of a recording were found to hold each other's signals."""

from collections.abc import Sequence
import re

from escalator_twin.signals import Finding

KIND = 'channel_swap'


def other_of(finding: Finding) -> str | None:
    """Return the channel that an exchanged one holds; None where the finding names none."""
    other = re.search(r'exchanged with (\S+)', finding.detail)
    return other.group(1) if other else None


def exchanged(findings: Sequence[Finding]) -> dict[str, str]:
    """Return of every exchanged channel the one whose gauges it holds.

    What is found without a model is told of channels as they were recorded, before plugs are known to be exchanged;
    signals are compared, and gains and creep told, with the channels put right.
    """
    pairs = [(f.channel, other_of(f)) for f in findings if f.kind == KIND]
    known = [(one, other) for one, other in pairs if other is not None]
    return dict(known) | {other: one for one, other in known}
