"""`mode-splitting`: an imperfection splits the degenerate modes of a symmetric body and fixes their axes.

pair (a, b) at f  ->  cos ψ a + sin ψ b at f(1 − ε/2),  −sin ψ a + cos ψ b at f(1 + ε/2)
    [Perrin & Charnley 1973; Rayleigh 1894, § 221]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.common.axes import about_axes, pair_at
from sonic_bullet.effects.protocol import Number, Numbers, Owner, SplitsPairs, Stage, Traits, sort_modes
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True)
class ModeSplitting(SplitsPairs):
    """Split pairs of modes, one number a pair."""

    id: ClassVar[str] = "mode-splitting"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Perrin & Charnley 1973"
    traits: ClassVar[Traits] = Traits(moves_modes=True, by_line=True)

    freq_hz: Annotated[Numbers, Number("(p,), middle frequency of each pair", least=1e-3, table="pairs")]
    split: Annotated[Numbers, Number("(p,), ε, relative", least=0.0, most=2.0, free=1, table="pairs")]
    turn_rad: Annotated[Numbers, Number("(p,), ψ from the pair's first mode in the mesh", free=1, table="pairs")]

    def apply(self, x: ModalModel) -> ModalModel:
        """Split the pairs of a body's modes and turn their axes."""
        freq, shape = x.freq_hz.copy(), x.shape.copy()
        for f, split, turn in zip(self.freq_hz, self.split, self.turn_rad, strict=True):
            if split == 0:
                continue
            a, b = pair_at(x.freq_hz, f)
            if a < 0:
                continue
            middle = (x.freq_hz[a] + x.freq_hz[b]) / 2
            freq[a], freq[b] = middle * (1 - split / 2), middle * (1 + split / 2)
            shape[:, :, [a, b]] = about_axes(x.shape[:, :, [a, b]], turn)
        return sort_modes(x, freq, x.decay_per_s, shape)

    def observed_correction(self, freq_hz: Array) -> Array:
        """Compute by how much, relative, modes differ from the middles of the observed pairs.

        Parameters
        ----------
        freq_hz : (m,)
            Frequencies of the mesh's modes, ascending.

        Returns
        -------
        (m,)
            0 for modes that belong to no observed pair.
        """
        off = np.zeros(len(freq_hz))
        for f in self.freq_hz:
            pair = list(pair_at(freq_hz, f))
            if pair[0] >= 0:
                off[pair] = f / freq_hz[pair].mean() - 1
        return off
