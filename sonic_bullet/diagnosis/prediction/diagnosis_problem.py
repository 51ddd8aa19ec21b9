"""What stays the same while effects are selected, and what a hypothesis scores on it.

    Struck bodies + comparable strikes + band + candidate effects + seed -> DiagnosisProblem;
        DiagnosisProblem × Hypothesis -> Score

Strikes are `Comparable`, so a problem can only be posed once somebody has asked `comparable` and seen to what it said:
where nothing can be compared there is no problem, and no score.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.diagnosis.prediction.prediction import Predictions
from sonic_bullet.diagnosis.prediction.score import Comparable, Score, Take, least_db, mean_db, predict_takes
from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.effects.protocol import Effect


def silent(_: str) -> None:
    """Progress that nobody wants."""


@dataclass(frozen=True, slots=True, eq=False)
class DiagnosisProblem:
    """bodies: every object. takes: what a hypothesis is held against. band_hz: of the recordings. effects: the
    candidates.

    seed: of all that is drawn. say: where progress goes. Raises ValueError where there is no strike, or no band.
    """

    bodies: tuple[Struck, ...]
    takes: Comparable
    band_hz: tuple[float, float]
    effects: tuple[type[Effect], ...] = ()
    seed: int = 0
    say: Callable[[str], None] = silent

    def __post_init__(self) -> None:
        if not self.takes:
            raise ValueError("a problem needs something to compare with")
        if not 0 <= self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"a band goes from a lower to a higher frequency, not {self.band_hz} Hz")

    @property
    def has_audio(self) -> bool:
        """Whether all that is compared was recorded: strikes, no lists of lines."""
        return all(isinstance(take, Take) for take in self.takes)

    @property
    def has_meshes(self) -> bool:
        """Whether every body has a mesh."""
        return all(body.family is not None for body in self.bodies)

    def predict(self, h: Hypothesis) -> Predictions:
        """What the hypothesis says of the bodies that the strikes are of."""
        return predict_takes(h, self.takes)

    def distance_db(self, h: Hypothesis) -> float:
        """Mean distance of the strikes from the hypothesis; ∞ where that plays nothing finite."""
        return mean_db(self.takes, self.predict(h))

    def score(self, h: Hypothesis) -> Score:
        """Distance and noise floor, means over the strikes."""
        return self.scored(self.predict(h))

    def scored(self, made: Predictions) -> Score:
        """The same of what has been predicted already."""
        return Score(mean_db(self.takes, made), least_db(self.takes, made))

    def only(self, *effects: type[Effect]) -> DiagnosisProblem:
        """The same with other candidates."""
        return replace(self, effects=effects)
