"""Loudness of a sound and its adjustment: meter, true peak, fades and limiter."""
