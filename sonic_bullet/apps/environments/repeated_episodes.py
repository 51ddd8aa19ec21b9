"""Check whether episodes of the same seed and actions have the same contacts.

PyBullet keeps contact points over a reset, and the order of its pairs, so the same seed can lead to other contacts.
Then the sound differs too, by the simulator alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b

from sonic_bullet.records.contacts import Step


class RepeatedEpisodes:
    """Hashes of the steps of seeded episodes, by seed and by the actions so far; the first episode is the reference.

    seeded: whether the present episode began from a seed; else it is not compared.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, bytes] = {}
        self._actions = self._steps = blake2b()
        self.seeded = self._differ = False

    def begin(self, seed: int | None) -> None:
        """Begin an episode."""
        self._actions, self._steps = blake2b(str(seed).encode(), digest_size=8), blake2b(digest_size=8)
        self.seeded, self._differ = seed is not None, False

    def differ(self, action: bytes, steps: Sequence[Step]) -> bool:
        """Tell whether poses or contacts of this episode differ so far from the first of its seed and actions."""
        # most env.steps of seeded episodes that are stored, 2.5 MB; the oldest are dropped first
        most_remembered = 16_384
        self._actions.update(action)
        for step in steps:
            self._steps.update(step.contacts.row.tobytes() + step.position_m.tobytes() + step.quaternion_xyzw.tobytes())
        key, now = self._actions.digest(), self._steps.digest()
        self._differ |= self._known.setdefault(key, now) != now
        if len(self._known) > most_remembered:
            del self._known[next(iter(self._known))]
        return self._differ
