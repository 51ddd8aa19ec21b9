"""Effects of inputs: modes, levels, onsets, decays; changes of a recording."""
