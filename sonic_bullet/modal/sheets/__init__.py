"""Modes of sheets: one layer of wedges on one of its sides, whose number goes with the area."""
