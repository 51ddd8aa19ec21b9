"""Worlds made of tables, whatever fills them: poses, twists and loaded contacts as arrays."""
