"""Rigid motions of the links of a jointed body, as a log holds them: mass-normalised, a row for each link and motion.

    joints and poses of a robot -> rigid_modes (listener) -> rows of LINK_MOTION in a Step -> speed of a link's surface

A pulse of impulse j at r on link l moves link s by Σ_d Ψ_s,d (Ψ_l,d · (j, r × j)): the articulated body's J M⁻¹ Jᵀ.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records.arrays import LARGEST_SI, Array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import LogError

LINK_MOTION = np.dtype(
    [("body", "i4"), ("mode", "i4"), ("rate_rad_s", "f8"), ("decay_per_s", "f8"), ("shape", "f8", (6,))], align=True
)
"""body: index in the log. mode: number of the motion, which links of one body share. rate_rad_s, decay_per_s: of a
motion that joint stiffness holds, 0 of a free one. shape: translation of the centre of mass in 1/√kg, rotation in
1/(√kg·m), body frame."""
MOTION_FIELDS: dict[str, tuple[type, tuple[int, ...]]] = {
    "body": (np.int32, ()),
    "mode": (np.int32, ()),
    "rate_rad_s": (float, ()),
    "decay_per_s": (float, ()),
    "shape": (float, (6,)),
}
"""The same fields one by one, as files hold them."""
NO_MOTIONS = np.zeros(0, LINK_MOTION)
NO_MOTIONS.setflags(write=False)


def as_motions(rows: object, body: Array) -> Array:
    """Return rows (r,) of LINK_MOTION of the bodies (b,) of a step, read-only. Raises LogError."""
    if rows is NO_MOTIONS:
        return NO_MOTIONS
    if not isinstance(rows, np.ndarray) or rows.dtype != LINK_MOTION or rows.ndim != 1:
        raise LogError(f"step: motions is {quote(rows)}", "give rows (r,) of LINK_MOTION")
    check_motions(rows, "step")
    if not np.isin(rows["body"], body).all():
        raise LogError("step: motions name a body that the step does not know", "use an unbroken contact log")
    if rows.flags.writeable:
        rows = rows.copy()
        rows.setflags(write=False)
    return rows


def check_motions(rows: Array, where: object) -> None:
    """Raise LogError where a number of LINK_MOTION rows is not finite or below what it may be."""
    numbers = np.column_stack([rows["rate_rad_s"], rows["decay_per_s"], rows["shape"]])
    finite = numbers.max(initial=0) <= LARGEST_SI and numbers.min(initial=0) >= -LARGEST_SI  # False for NaN too
    if not finite or min(rows[name].min(initial=0) for name in ("rate_rad_s", "decay_per_s", "mode")) < 0:
        raise LogError(f"{where}: motions that are not finite, or of a negative rate", "use an unbroken contact log")
