"""Modal identification: the damped sinusoids that strikes share, each with its spread."""
