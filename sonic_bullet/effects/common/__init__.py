"""Methods that several effects use.

Axes of degenerate pairs, envelopes, patterns, points on surfaces, pulses, sums of modes, hum, reverberant tails,
dashpots.
"""
