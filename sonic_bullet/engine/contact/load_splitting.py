"""Steps over which the engine splits loads into support and strikes: src/contact/load_splitting.hpp.

SPAN: what lasts as many steps is support; NOW: column of a load history that is the step being rendered; LOOKAHEAD:
steps known beyond it; HISTORY: columns.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import HISTORY, LOOKAHEAD, NOW, SPAN
from sonic_bullet.records import Array

__all__ = ["HISTORY", "LOOKAHEAD", "NOW", "SLIDES_M_S", "SPAN", "settling_m_s"]

SLIDES_M_S = 1e-3
"""Speed of a contact over a surface below which nothing rolls or slides: a settled pile creeps at a tenth of it."""


def settling_m_s(fall_m_s: Array, normal: Array) -> Array:
    """Compute the approach (k,) of contacts that gravity alone explains within SPAN steps (src/contact/strike_forces).

    fall_m_s, normal : (k, 3)
        Gravity times the step's length; the contacts' normals.
    """
    toward = np.abs(np.einsum("ki,ki->k", fall_m_s, normal))
    return np.asarray(SPAN * (1.1 * toward + 0.01 * np.linalg.norm(fall_m_s, axis=1)))
