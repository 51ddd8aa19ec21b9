"""Numbers of the search for dashpots."""

from __future__ import annotations

# of what dashpots add to a decay, of the decay, and of a pattern, relative: shapes err, and laws
ADDED_DECAY_ERROR = 0.05
DAMPING_LAW_ERROR = 0.02
PATTERN_ERROR = 0.15
DASHPOT_PAIR_WIDTH = 0.004  # of ln f, of a pair
DECAY_PAIR_WIDTH = 0.4  # of ln d, of a pair
LINE_LEVEL_ERROR = 0.3  # of ln of a line's level
# squared spreads from where on a decay's misfit costs less, and that a pattern costs which nothing explains
MISSED_COST = 9.0
# that a decay costs at most: a few spreads may be a shape's error, half or twice is none
MOST_DECAY_COST = 4 * MISSED_COST
MOST_LINE_COST = 2 * MOST_DECAY_COST + MISSED_COST
SILENT_MODE_COST = MISSED_COST  # of a mode that no line shows: a mesh may have it elsewhere
