"""Values -> pictures."""
