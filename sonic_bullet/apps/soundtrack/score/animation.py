"""An animation by value: bodies, and their poses at each frame; made by every reader, taken by every scoring method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.arrays import store
from sonic_bullet.records.coerce import as_kinds, as_number, quote
from sonic_bullet.records.contacts import UNIT_QUATERNION
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AnimationError
from sonic_bullet.simulators.animated import AnimatedBody, rotation
from sonic_bullet.simulators.frames import LINK_STATE

# a body that moves less from its first pose all the time does not move: a hundredth of a millimetre
STILL_M = 1e-5
STILL_RAD = 1e-4


def check_orientations(names: Sequence[str], turn: Array) -> None:
    """Raise AnimationError, with body and frame, where a quaternion (t, b, 4) is not finite or has not the length 1."""
    if turn.ndim != 3 or turn.dtype.kind not in "fiu":
        return  # the record's own check reports it
    length = np.linalg.norm(turn.astype(float), axis=2)
    wrong = ~(np.abs(length - 1) <= UNIT_QUATERNION)
    if wrong.any():
        frame, body = (int(i) for i in np.argwhere(wrong)[0])
        found = length[frame, body]
        what = "no number" if not np.isfinite(found) else "zero" if found == 0 else f"{found:.3g} long, not 1"
        raise AnimationError(
            f"the quaternion of {quote(names[body])} in frame {frame} (the first is 0) is {what}",
            "export orientations as unit quaternions (x, y, z, w)",
        )


@dataclass(frozen=True, slots=True, eq=False)
class Animation:
    """Bodies and their poses at each frame.

    Attributes
    ----------
    fps
        Frames a second.
    position_m, quaternion_xyzw : (t, b, 3), (t, b, 4)
        Body frames (centre of mass, principal axes), right-handed world.
    gravity_m_s2 : (3,)
    materials
        By a body's name, a preset's name or file; other bodies are silent partners.
    """

    fps: float
    bodies: tuple[AnimatedBody, ...]
    position_m: Array
    quaternion_xyzw: Array
    gravity_m_s2: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    materials: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the numbers, and that something moves."""
        remedy = "give a frame rate from 5 to 10000"
        slowest_fps, fastest_fps = 5.0, 10_000.0
        fps = as_number(self.fps, "fps", remedy, least=slowest_fps, most=fastest_fps, error=AnimationError)
        bodies = as_kinds(self.bodies, AnimatedBody, "bodies", "give AnimatedBody", error=AnimationError)
        place = frozen_array(self.position_m, float, (None, len(bodies), 3), "animation: position_m")
        check_orientations([one.name for one in bodies], np.asarray(self.quaternion_xyzw))
        turn = np.array(
            frozen_array(self.quaternion_xyzw, float, (len(place), len(bodies), 4), "animation: quaternion")
        )
        length = np.linalg.norm(turn, axis=2, keepdims=True)
        if not bodies or len(place) < 3:
            raise AnimationError(
                f"{format_count(len(bodies), 'body', 'bodies')} in {format_count(len(place), 'frame')}",
                "an animation needs a body and three frames",
            )
        turn /= length
        names = [one.name for one in bodies]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise AnimationError(f"two bodies are called {quote(twice)}", "give each its own name")
        turn.setflags(write=False)
        store(self, fps=fps, bodies=bodies, position_m=place, quaternion_xyzw=turn,
              gravity_m_s2=frozen_array(self.gravity_m_s2, float, (3,), "animation: gravity_m_s2"))  # fmt: skip
        if not self.moving.any():
            raise AnimationError("nothing moves in the animation", "bake the simulation to keyframes, and export those")

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.position_m)

    @property
    def moving(self) -> Array:
        """Which bodies (b,) ever leave their first pose."""
        away = np.abs(self.position_m - self.position_m[0]).max(axis=(0, 2)) > STILL_M
        same = np.abs((self.quaternion_xyzw * self.quaternion_xyzw[0]).sum(axis=2)).min(axis=0)
        return np.asarray(away | (2 * np.arccos(np.clip(same, 0, 1)) > STILL_RAD))

    @property
    def free(self) -> Array:
        """Which bodies (b,) are moved by gravity and contacts alone."""
        return np.array([one.mass_kg > 0 and not one.driven for one in self.bodies], bool)

    @property
    def turn_rad(self) -> Array:
        """Angle (t - 1, b) by which each body rotates from frame to frame, without whole turns."""
        return np.asarray(np.linalg.norm(rotation(self.quaternion_xyzw[:-1], self.quaternion_xyzw[1:]), axis=-1))

    def poses(self) -> Array:
        """Return MOTION (t, b) of all frames, with the mean speeds since the frame before.

        In the first frame, those since a frame before it that gravity alone would have led from. A semi-implicit
        integrator starts its step with just these: x(n) = x(n-1) + v(n)·dt.
        """
        motion = np.zeros(self.position_m.shape[:2], LINK_STATE)
        motion["position_m"], motion["quaternion_xyzw"] = self.position_m, self.quaternion_xyzw
        motion["velocity_m_s"][1:] = np.diff(self.position_m, axis=0) * self.fps
        motion["spin_rad_s"][1:] = rotation(self.quaternion_xyzw[:-1], self.quaternion_xyzw[1:]) * self.fps
        motion["velocity_m_s"][0] = motion["velocity_m_s"][1]
        motion["velocity_m_s"][0][self.free] -= self.gravity_m_s2 / self.fps
        motion["spin_rad_s"][0] = motion["spin_rad_s"][1]
        return motion
