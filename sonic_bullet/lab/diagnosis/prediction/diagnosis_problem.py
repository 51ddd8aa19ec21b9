"""The fixed part of a selection of effects, and the score of a hypothesis in it.

    Struck bodies + comparable strikes + band + candidate effects + seed -> DiagnosisProblem;
        DiagnosisProblem × Hypothesis -> Score

Strikes are `Comparable`, so a problem can only be posed after `comparable`: where nothing can be compared there is no
problem, and no score.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sonic_bullet.effects.protocol import Effect
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions
from sonic_bullet.lab.diagnosis.prediction.score import (
    AudioObservation,
    Comparable,
    Score,
    least_db,
    mean_db,
    predict_takes,
)
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody


@dataclass(frozen=True, slots=True, eq=False)
class DiagnosisProblem:
    """What stays the same while effects are selected.

    Attributes
    ----------
    bodies : tuple of StruckBody
        Every object.
    takes : Comparable
        What a hypothesis is compared with.
    band_hz : (2,)
        Of the recordings.
    effects : tuple of types
        The candidates.
    seed : int
        Of all that is drawn.

    Raises
    ------
    ValueError
        There is no strike, or no band.
    """

    bodies: tuple[StruckBody, ...]
    takes: Comparable
    band_hz: tuple[float, float]
    effects: tuple[type[Effect], ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        """Check that there is something to compare with, and a band."""
        if not self.takes:
            raise ValueError("a problem needs something to compare with")
        if not 0 <= self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"a band goes from a lower to a higher frequency, not {self.band_hz} Hz")

    @property
    def has_audio(self) -> bool:
        """Decide whether all that is compared are recordings, no lists of lines."""
        return all(isinstance(take, AudioObservation) for take in self.takes)

    @property
    def has_meshes(self) -> bool:
        """Decide whether every body has a mesh."""
        return all(body.family is not None for body in self.bodies)

    def predict(self, h: Hypothesis) -> Predictions:
        """Predict the bodies that the strikes are of."""
        return predict_takes(h, self.takes)

    def distance_db(self, h: Hypothesis) -> float:
        """Compute the mean distance of the strikes from the hypothesis; ∞ where it gives no finite sound."""
        return mean_db(self.takes, self.predict(h))

    def score(self, h: Hypothesis) -> Score:
        """Compute distance and noise floor, means over the strikes."""
        return self.score_predictions(self.predict(h))

    def score_predictions(self, made: Predictions) -> Score:
        """Compute the same of a prediction at hand."""
        return Score(mean_db(self.takes, made), least_db(self.takes, made))

    def only(self, *effects: type[Effect]) -> DiagnosisProblem:
        """Return the problem with other candidates."""
        return replace(self, effects=effects)
