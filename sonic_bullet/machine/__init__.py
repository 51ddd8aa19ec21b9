"""Platform: compiled code, progress, supervised processes."""
