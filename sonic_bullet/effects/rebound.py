"""`rebound`: the striker bounces and hits again.

f(t) = J Σ_i e^i δ(t − t_i),   t_{i+1} − t_i = g e^i
    flight 2v/g' and impulse both fall by the restitution e at every bounce
    [Goldsmith 1960, ch. 1; Falcon et al. 1998, eq. 1]
g goes as the impulse (free flight), or is the arm's own, whatever J
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Effect, Impact, Number, Owner, Stage

MOST_HITS = 8
"""Hits of a strike, the first included, that are played or looked for at most."""


@dataclass(frozen=True)
class Rebound(Effect):
    """Hits of one strike after the first."""

    id: ClassVar[str] = "rebound"
    stage: ClassVar[Stage] = Stage.FORCE
    owner: ClassVar[Owner] = Owner.STRIKER
    reference: ClassVar[str] = "Goldsmith 1960, ch. 1; Falcon et al. 1998"

    gap_s: Annotated[float, Number("first gap at the impulse `impulse_n_s`", least=0.0, free=1)]
    impulse_n_s: Annotated[float, Number("reference impulse", least=0.0, key="J0_n_s")]
    restitution: Annotated[float, Number("each hit's impulse over that of the one before", least=0.0, free=1)]
    exponent: Annotated[float, Number("of the impulse: gaps go as impulse^exponent", free=1)] = 0.0
    shrink: Annotated[float | None, Number("each gap over the last, None: restitution", key="gap_ratio")] = None
    hits: Annotated[int, Number("hits, the first included", least=1)] = MOST_HITS

    def apply(self, x: Impact) -> Impact:
        """Repeat the impact's hits."""
        faint = 0.02  # of the first hit: weaker ones are not played
        gap = self.gap_s * (x.impulse_n_s / self.impulse_n_s) ** self.exponent
        ratio = self.restitution if self.shrink is None else self.shrink
        share = self.restitution ** np.arange(self.hits)
        share = share[share > faint]
        when = gap * np.concatenate([[0.0], np.cumsum(ratio ** np.arange(len(share) - 1))])
        delay = (x.delay_s[:, None] + when).ravel()
        return replace(x, delay_s=delay, share=(x.share[:, None] * share).ravel())

    def parameters(self) -> dict[str, Any]:
        """Return its numbers by name; the ratio of gaps is the restitution where none is set."""
        return super().parameters() | {"gap_ratio": self.restitution if self.shrink is None else self.shrink}
