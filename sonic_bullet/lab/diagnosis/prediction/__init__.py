"""Prediction of a body by a hypothesis: modes, impacts, vibration, sound, and the distance from the recordings."""
