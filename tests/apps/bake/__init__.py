"""Baked models: records, pruning, points, and files that are wrong."""
