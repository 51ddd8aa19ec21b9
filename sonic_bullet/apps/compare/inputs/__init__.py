"""Inputs of two versions: paired, substituted, and the smallest set that is the cause."""
