"""Problems for the diagnosis' own parts: some bodies, some strikes, whatever candidates."""

from __future__ import annotations

from collections.abc import Sequence

from sonic_bullet.effects.protocol import Effect
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.score import Comparable, ScoredObservation
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody

BAND = (50.0, 7_500.0)


def posed(
    bodies: tuple[StruckBody, ...], takes: Sequence[ScoredObservation], *effects: type[Effect], seed: int = 0
) -> DiagnosisProblem:
    """The problem of these strikes, all of which are known to be comparable."""
    return DiagnosisProblem(bodies, Comparable(tuple(takes)), BAND, effects, seed)
