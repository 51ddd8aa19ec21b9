"""What several effects share: axes of degenerate pairs, envelopes, patterns, points on surfaces, pulses, ringing, hum,
reverberant tails, dashpots.
"""
