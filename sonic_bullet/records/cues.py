"""Named places in a sound file."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.records.coerce import as_text, as_whole


@dataclass(frozen=True, slots=True)
class Cue:
    """A place in a sound file: its first sample, its duration in samples (0: a point), and its label."""

    sample: int
    samples: int
    label: str

    def __post_init__(self) -> None:
        """Check the fields."""
        for name in ("sample", "samples"):
            as_whole(getattr(self, name), f"{name} of a cue", "count from the start of the file", least=0)
        as_text(self.label, "label of a cue", "give a text")
