"""Inputs of two versions: side by side, put back, and the smallest set that is the cause."""
