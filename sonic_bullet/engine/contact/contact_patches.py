"""Tables of contact patches and support states, and the time for new poles that is saved up at most: the engine's.

What they mean: src/contact/contact_patches.hpp; their fields: src/tables.hpp.
"""

from sonic_bullet._engine import CONTACT_PATCH, SAVED_S, SUPPORT_STATE

__all__ = ["CONTACT_PATCH", "SAVED_S", "SUPPORT_STATE"]
