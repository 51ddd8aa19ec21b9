"""Counts in messages: "1 strike", "2 strikes"; a module without slow imports."""

from __future__ import annotations


def format_count(number: int, one: str, several: str = "") -> str:
    """Format a number with its noun: "1 strike", "2 strikes"; several: a plural that is not the singular with an s."""
    return f"{number} {one if number == 1 else several or one + 's'}"
