"""A material's surface form in a contact log: numbers in the header, the track as an array of its own."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from sonic_bullet.files.storage.container import take
from sonic_bullet.records import Array, Material
from sonic_bullet.records.touching.surface_form import SurfaceForm


class LoggedForm(msgspec.Struct, omit_defaults=True):
    """`SurfaceForm` but for its track; track_spacing_m None: it has none."""

    waviness_m: float = 0.0
    waviness_length_m: float = 2e-3
    track_spacing_m: float | None = None


def pack_form(form: SurfaceForm | None) -> LoggedForm | None:
    """Convert a form to the header's struct."""
    if form is None:
        return None
    spacing = None if form.track_m is None else float(form.track_spacing_m)
    return LoggedForm(float(form.waviness_m), float(form.waviness_length_m), spacing)


def track_arrays(index: int, material: Material) -> dict[str, Array]:
    """Return the array of material ``index`` by its name in a log, none where it has no track."""
    form = material.form
    return {} if form is None or form.track_m is None else {f"track{index}": form.track_m}


def unpack_form(form: LoggedForm | None, arrays: Mapping[str, Array], index: int, path: object) -> SurfaceForm | None:
    """Build a material's form; raises LogError, RecordError."""
    if form is None:
        return None
    if form.track_spacing_m is None:
        return SurfaceForm(form.waviness_m, form.waviness_length_m)
    track = take(arrays, f"track{index}", float, (None,), path)
    return SurfaceForm(form.waviness_m, form.waviness_length_m, track, form.track_spacing_m)
