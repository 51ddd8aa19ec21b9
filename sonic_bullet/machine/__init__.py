"""Platform: private folders, locked unfinished files, compiled code, progress, supervised processes."""
