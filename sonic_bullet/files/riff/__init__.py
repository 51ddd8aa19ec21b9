"""Chunks of a WAV file besides its samples."""
