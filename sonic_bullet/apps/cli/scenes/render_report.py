"""Report of a sound that was rendered and written: its log, its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from sonic_bullet.apps.report.plots.scene_plot import quantity
from sonic_bullet.files import AudioReport, ContactLog
from sonic_bullet.records.counts import format_count


@dataclass(frozen=True, slots=True)
class RenderReport:
    """Report of `render`, `score` and of each take. lifted: see `Listener.lifted`; None: not counted."""

    log: ContactLog
    audio: AudioReport
    notes: tuple[str, ...] = ()
    lifted: Mapping[str, tuple[int, int]] | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the file's figures, and bodies, events and settings of the log."""
        return {
            "output": self.audio.path,
            "format": self.audio.format,
            "subtype": self.audio.subtype,
            "sr": self.audio.sr,
            "channels": self.audio.channels,
            "frames": self.audio.frames,
            "seconds": self.audio.seconds,
            "peak_pa": self.audio.peak_pa,
            "rms_pa": self.audio.rms_pa,
            "gain_per_pa": self.audio.gain_per_pa,
            "clipped": self.audio.clipped,
            "steps": len(self.log.steps),
            "contacts": len(self.log),
            "bodies": _bodies(self.log),
            "events": [{"kind": x.kind, "step": x.step, "body": x.body} for x in self.log.events],
            "changes": [{"step": x.step, "body": x.body, "values": dict(x.values)} for x in self.log.changes],
            "supports": self.log.supports,
            "image": self.log.image,
            "lifted": None if self.lifted is None else {name: list(of) for name, of in self.lifted.items()},
            "engine": dict(self.log.engine),
            "versions": dict(self.log.versions),
            "notes": list(self.notes),
        }

    def lines(self) -> list[str]:
        """Describe the file written in one line."""
        channels = format_count(self.audio.channels, "channel")
        scale = "" if self.audio.gain_per_pa == 1 else f", scaled by {self.audio.gain_per_pa:.4g}"
        scale += ", clipped" if self.audio.clipped else ""
        units = {quantity(sensor)[1] for sensor in self.log.sensors}
        unit = units.pop() if len(units) == 1 else "(mixed units)"
        return [
            f"{self.audio.path}: {self.audio.seconds:.3f} s, {channels}, {self.audio.sr} Hz, "
            f"peak {self.audio.peak_pa:.4g} {unit}, rms {self.audio.rms_pa:.4g} {unit}{scale}"
        ]


def _bodies(log: ContactLog) -> list[dict[str, Any]]:
    return [
        {
            "body": body.body_id,
            "link": body.link,
            "name": body.name.encode("utf-8", "replace").decode(),
            "material": None if body.material is None else body.material.name,
            "modes": None if body.model is None or body.model.unsolved else body.model.mode_count,
            "dropped": None if body.model is None or body.model.unsolved else body.model.dropped,
            "since_step": body.since_step,
            "until_step": body.until_step,
            "mounting": body.mounting,
            "options": None if body.options is None else asdict(body.options),
            "dynamics": dict(body.dynamics),
        }
        for body in log.bodies
    ]
