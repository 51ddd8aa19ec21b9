"""Physics that several effects share: axes of degenerate pairs, points of surfaces, pulses, sums of modes, dashpots."""
