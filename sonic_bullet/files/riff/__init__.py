"""What stands in a WAV file besides samples."""
