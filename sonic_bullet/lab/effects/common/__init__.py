"""Methods of several searches: envelopes, pairs of lines and modes, places, hum, reverberant tails, optimisers."""
