"""Searches of several recordings of one machine, by what they name alone."""

from dataclasses import replace
from types import SimpleNamespace

from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal

LONGER_M, TOLD_M = 1.5e-4, 1.9e-4  # hidden; where the fit begins
CHAIN = Proposal(
    'chain_elongation', {'side': 'both'}, {'length_m': TOLD_M}, 1e4, fitted=('length_m',)
)
LINK = Proposal('link_elongation', {'link': 12}, {'length_m': 3e-3}, 1e4, fitted=('length_m',))


def found_of(proposal, sd=1.0, probability=0.99):
    return Found(proposal, probability, {proposal.fitted[0]: sd}, 500.0, ())


def scout(*effects, level=1e4, turned=None):
    return SimpleNamespace(
        found=tuple((found_of(e, 1e-5), 0.99) for e in effects), level=level, turned=turned or {}
    )


def told(length_m):
    return replace(CHAIN, parameters={'length_m': length_m})
