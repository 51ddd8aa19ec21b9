"""Hypothesis × body -> modes, impacts, ringing, sound, and how far that is from what was recorded."""
