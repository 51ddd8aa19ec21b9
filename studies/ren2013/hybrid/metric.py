"""The hybrid metric: how far damped sinusoids are from a recording, by image and by features.

    Π = Π_psycho/|Π_MRP|                                                              [Ren, Yeh, Lin 2013, eq. 27]

Π_psycho is divided by its value for silence (image.py), so that Π has no unit and its minimum stays where it was. The
constants the paper's lost appendix held are the fields of `Constants`; docs/measured/estimator.md shows what hangs on
them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.errors import RecordError
from studies.ren2013.hybrid.image import Image, distance, image
from studies.ren2013.hybrid.matching import Points, match_ratio_product, points

MATCH_FLOOR = 1e-6  # a match ratio product of zero would make Π infinite
PASCAL_DB_SPL = 94.0  # of an rms of 1 where samples are pascals


@dataclass(frozen=True, slots=True)
class Constants:
    """What the metric leaves free: the image's grid (image.py), the plane of the match ratio product (matching.py)."""

    bark_step: float = 0.5
    levels: int = 5
    shortest_s: float = 0.0107
    seconds: float = 1.0
    per_bark: float = 4.0
    per_duration: float = 1.0
    near: float = 0.1
    power: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A recording's image and points, worked out once."""

    image: Image
    points: Points


def target(
    features: Features,
    signal: Array,
    *,
    full_scale_db_spl: float = PASCAL_DB_SPL,
    constants: Constants | None = None,
) -> Target:
    """A recording (n,) at features.sr, full scale 1, and its features as what others are held against.

    full_scale_db_spl: the level an rms of 1 stands for. Raises RecordError where there are no features, a sample is not
    finite, or the recording is too short or too quiet for an image.
    """
    c = constants or Constants()
    if not len(features.freq_hz):
        raise RecordError("the recording has no features", "a comparison needs at least one damped sinusoid")
    made = image(
        frozen_array(signal, np.float64, (None,), "signal"), features.sr, features.onset_s, full_scale_db_spl,
        bark_step=c.bark_step, levels=c.levels, shortest_s=c.shortest_s, seconds=c.seconds,
    )  # fmt: skip
    return Target(
        made,
        points(features, per_bark=c.per_bark, per_duration=c.per_duration, near=c.near, power=c.power),
    )


def hybrid_of_modes(target: Target, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> float:
    """Π of damped sinusoids (m,) Im A e^{(−d + iω)t}, whatever made them.

    A real: sines; complex: of any phase.
    """
    return distance(target.image, freq_hz, decay_per_s, amplitude) / match_of_modes(
        target, freq_hz, decay_per_s, amplitude
    )


def match_of_modes(target: Target, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> float:
    """|Π_MRP| of damped sinusoids (m,), at least `MATCH_FLOOR`."""
    return max(-match_ratio_product(target.points, freq_hz, decay_per_s, np.abs(amplitude)), MATCH_FLOOR)
