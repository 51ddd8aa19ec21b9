"""What a surface has beside its octaves of roughness: waves of its manufacture, and a track that was measured.

waviness W, length L: waves W√2 sin(2πx/L), of crests of curvature √2 W (2π/L)²      [ISO 4287:1997, W-profile]
track: heights at even distances, read round and round                              [KHR_audio_rigid_bodies, profile]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.coerce import as_number


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceForm:
    """Waviness and measured track of a surface.

    Parameters
    ----------
    waviness_m
        rms height of its waves above the finish, at most a tenth of their length; 0: none.
    waviness_length_m
        Their wavelength, at most 1 m.
    track_m : Array, shape (n,)
        Heights of a measured track, played one by one in place of the octaves; None: none.
    track_spacing_m
        Distance of two of them.
    """

    waviness_m: float = 0.0
    waviness_length_m: float = 2e-3
    track_m: Array | None = None
    track_spacing_m: float = 1e-6

    def __post_init__(self) -> None:
        """Check the fields."""
        longest_m, steepest = 1.0, 0.1  # beyond, heights are a body's shape, and not waves on its surface
        length = as_number(
            self.waviness_length_m, "waviness_length_m", "give metres above 0, up to 1", above=0, most=longest_m
        )
        most = steepest * length
        remedy = f"give an rms height of 0 to a tenth of waviness_length_m, {most:.3g} m"
        store(
            self,
            waviness_m=as_number(self.waviness_m, "waviness_m", remedy, least=0, most=most),
            waviness_length_m=length,
            track_spacing_m=as_number(self.track_spacing_m, "track_spacing_m", "give metres above 0", above=0),
        )
        track_heights_most = 1 << 22
        if self.track_m is not None:
            track = frozen_array(self.track_m, float, (None,), "track_m")
            require(2 <= len(track) <= track_heights_most, f"a track of {len(track)} heights", "give 2 to 4 million")
            store(self, track_m=track)

    @property
    def crest_per_m(self) -> float:
        """Curvature of the waves' crests."""
        return float(np.sqrt(2) * self.waviness_m * (2 * np.pi / self.waviness_length_m) ** 2)


def waves_of(waviness_m: float, waviness_length_m: float) -> SurfaceForm | None:
    """Return a form of waves alone; None where they have no height."""
    return SurfaceForm(waviness_m, waviness_length_m) if waviness_m > 0 else None
