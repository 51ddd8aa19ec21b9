"""How messages count: "1 strike", "2 strikes"; without what takes long to import."""

from __future__ import annotations


def format_count(number: int, one: str, several: str = "") -> str:
    """How many there are of what: "1 strike", "2 strikes"; several: where a plural is not the singular with an s."""
    return f"{number} {one if number == 1 else several or one + 's'}"
