"""Scenes with one thing changed, and what a comparison must say of them: see `benchmarks/planted_changes.py`."""
