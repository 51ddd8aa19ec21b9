"""Scenes of rigid bodies by value, to and from a PyBullet world."""
