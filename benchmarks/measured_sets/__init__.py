"""Measured sets: each fitted on one part and judged on another. benchmarks/measured.py is the entry."""
