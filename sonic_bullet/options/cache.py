"""Options of `cache` and `doctor`."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.options.option import Options, option
from sonic_bullet.options.render import client_option, json_option


@dataclass(frozen=True, slots=True, kw_only=True)
class CacheOptions(Options):
    """What is kept between runs."""

    clear: bool = option(False, "Remove all of it.")
    limit: str | None = option(
        None, "Remove what was computed and unused for longest, until SIZE of it is left, 500MB say.", metavar="SIZE"
    )
    json_to: str | None = json_option()


@dataclass(frozen=True, slots=True, kw_only=True)
class DoctorOptions(Options):
    """A scene's settings."""

    seconds: float = option(1.0, "How long to watch the scene run.", metavar="S", above=0)
    client: int | None = client_option()
    json_to: str | None = json_option()
