"""Findings about a world that would spoil its sound, and the links they concern."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sonic_bullet.simulators.pybullet.body_facts import describe_link
from sonic_bullet.simulators.pybullet.poses import read_roster

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A condition that would spoil the sound.

    Parameters
    ----------
    id
        Of the kind of finding.
    severity
        "error" (no sound), "warning" (wrong sound), "info".
    what, remedy
        One line each.
    """

    id: str
    severity: Severity
    what: str
    remedy: str


def all_links(client_id: int) -> list[tuple[int, int]]:
    """List body and link of every link in a world, bases too."""
    return [(body, link) for body, joints, _ in read_roster(client_id).bodies for link in range(-1, joints)]


def name_links(client_id: int, links: list[tuple[int, int]]) -> str:
    """Name the first of these links, and count the others."""
    first = describe_link(client_id, *links[0])
    return first if len(links) == 1 else f"{first} and {len(links) - 1} more"
