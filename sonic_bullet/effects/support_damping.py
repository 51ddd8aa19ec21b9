"""`support-damping`: a fixture takes energy where it is in contact with the body.

    q̈ + (2d + Σ_j c_j Φ_jᵀΦ_j) q̇ + Λq = 0      c in N·s/m; Φ_j: φ(p_j)·n, or φ(p_j) in every direction
        [Zheng & James 2011; Woodhouse 1998, eq. 12]

to first order Δd_k = ½ Σ_j c_j |φ_k(p_j)|²; degenerate modes turn to the dashpot, and strong dashpots couple modes:
`dashpots`. Identified by decays and patterns together: the modes under dashpots all over the surface are compared with
the lines, beside a smooth law of the material; one after another the best are taken, while each explains enough of what
is left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.common.dashpots import damp_model
from sonic_bullet.effects.common.points import nearest, vertex_normals
from sonic_bullet.effects.protocol import ActsAtPlaces, Cost, Mixing, Number, Numbers, Owner, Stage, Traits
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True)
class SupportDamping(ActsAtPlaces):
    """Dashpots on the surface, one entry a dashpot."""

    id: ClassVar[str] = "support-damping"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.FIXTURE
    reference: ClassVar[str] = "Zheng & James 2011, section 5 (contact damping); Woodhouse 1998, eq. 12"
    traits: ClassVar[Traits] = Traits(moves_modes=True, mixing=Mixing.NEIGHBOURS, cost=Cost.SEARCHES)

    position_m: Annotated[tuple[tuple[float, float, float], ...], Number("(j, 3), in the mesh's frame", free=2)]
    strength_n_s_m: Annotated[Numbers, Number("(j,), c in N·s/m", least=0.0, free=1, key="c_n_s_m")]
    along: tuple[str, ...] = ()  # (j,): "normal" to the surface, or "every" direction; () all normal

    def apply(self, x: ModalModel) -> ModalModel:
        """Compute the modes of the body under the dashpots."""
        if not any(self.strength_n_s_m) or not x.mode_count:
            return x
        normal = vertex_normals(x)
        rows: list[Array] = []
        for place, c, direction in zip(
            self.position_m, self.strength_n_s_m, self.along or ("normal",) * len(self.position_m), strict=True
        ):
            at = nearest(x, place)
            phi = x.shape[at].astype(float)
            rows.append(np.sqrt(c) * (phi if direction == "every" else normal[at][None] @ phi))
        return damp_model(x, np.concatenate(rows))

    def places(self) -> tuple[tuple[float, float, float], ...]:
        """Return the dashpots' places."""
        return self.position_m
