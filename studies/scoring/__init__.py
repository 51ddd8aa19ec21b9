"""Scenes of known truth for score.py, and what the run time makes of a log."""
