"""What inputs did: modes, levels, onsets, decays; what became of a recording."""
