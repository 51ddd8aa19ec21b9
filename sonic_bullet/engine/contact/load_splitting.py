"""Steps over which the engine splits loads into support and strikes: src/contact/load_splitting.hpp.

SPAN: what lasts as many steps is support; NOW: column of a load history that is the step being rendered; LOOKAHEAD:
steps known beyond it; HISTORY: columns.
"""

from sonic_bullet._engine import HISTORY, LOOKAHEAD, NOW, SPAN

__all__ = ["HISTORY", "LOOKAHEAD", "NOW", "SPAN"]
