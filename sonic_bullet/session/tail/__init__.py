"""Modes of a body above the last one that was solved."""
