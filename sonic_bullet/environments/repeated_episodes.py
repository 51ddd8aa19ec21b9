"""Whether an episode that begins from a seed and is given the same actions as one before meets the same contacts.

PyBullet keeps contact points over a reset, and the order in which it looks at pairs, so the same seed can lead to other
contacts. Then the sound is another too, and nobody but the simulator is to blame.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b

from sonic_bullet.records.contacts import Step

MOST_REMEMBERED = 16_384
"""env.steps of seeded episodes, 2.5 MB; the oldest go first."""


class RepeatedEpisodes:
    """What the steps of seeded episodes held, by seed and by the actions so far: the first to come counts.

    seeded: whether the present episode began from a seed; else it is compared with none.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, bytes] = {}
        self._actions = self._steps = blake2b()
        self.seeded = self._differ = False

    def begin(self, seed: int | None) -> None:
        """An episode begins."""
        self._actions, self._steps = blake2b(str(seed).encode(), digest_size=8), blake2b(digest_size=8)
        self.seeded, self._differ = seed is not None, False

    def differ(self, action: bytes, steps: Sequence[Step]) -> bool:
        """Whether this env.step, or one before it in this seeded episode, held other poses or contacts than in the
        first episode of this seed and these actions.
        """
        self._actions.update(action)
        for step in steps:
            self._steps.update(step.contacts.row.tobytes() + step.position_m.tobytes() + step.quaternion_xyzw.tobytes())
        key, now = self._actions.digest(), self._steps.digest()
        self._differ |= self._known.setdefault(key, now) != now
        if len(self._known) > MOST_REMEMBERED:
            del self._known[next(iter(self._known))]
        return self._differ
