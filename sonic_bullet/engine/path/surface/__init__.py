"""What sensors on a surface read: its rigid motion beside its modes, and their own chain."""
