# SPDX-FileCopyrightText: 2026 the authors of sonic_bullet
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the `sonic-bullet` command beside Blender: found, started, followed, cancelled. Knows no bpy, waits for nothing.

poses.npz -> sonic-bullet score -> contacts.npz -> sonic-bullet render -> sound.wav, events.json, stems
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HOW_TO_INSTALL = (
    "sonic-bullet was not found. In a terminal, in its folder: python3 -m venv sound; sound/bin/pip install . "
    "Then name sound/bin/python in the add-on's preferences."
)


class BakeError(Exception):
    """What went wrong, in a line, and its remedy."""


def find_command(chosen: str = "") -> list[str] | None:
    """Return the words that run sonic-bullet: of a Python or command that was chosen, else of PATH; None: nowhere."""
    if chosen:
        place = shutil.which(os.path.expanduser(chosen))
        if place is None:
            return None
        is_python = re.fullmatch(r"(python|pypy)[\d.]*w?(\.exe)?", Path(place).name.lower()) is not None
        return [place, "-m", "sonic_bullet"] if is_python else [place]
    place = shutil.which("sonic-bullet")
    return None if place is None else [place]


@dataclass
class BakeJob:
    """Sound of exported poses, made in ``folder``, then moved to ``sound``.

    microphone_m: in the world, m, z up; stems: also a sound a body, beside it.
    """

    command: list[str]
    folder: Path
    sound: Path
    microphone_m: tuple[float, float, float]
    stems: bool = False
    said: str = "starting"
    fraction: float = 0.0
    error: str = ""
    cancelled: bool = False
    process: subprocess.Popen[str] | None = None
    thread: threading.Thread | None = field(default=None, repr=False)

    @property
    def poses(self) -> Path:
        """Where the poses are written before it starts."""
        return self.folder / "poses.npz"

    @property
    def running(self) -> bool:
        """Whether it is under way."""
        return self.thread is not None and self.thread.is_alive()

    def start(self) -> None:
        """Run both commands in a thread."""
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def cancel(self) -> None:
        """End the command, and leave nothing."""
        self.cancelled = True
        process = self.process
        if process is not None and process.poll() is None:
            if os.name == "posix":
                os.killpg(process.pid, signal.SIGTERM)
            else:
                process.terminate()
        if self.thread is not None:
            self.thread.join(timeout=10)
        self.clear()

    def clear(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def events(self) -> list[dict[str, Any]]:
        """Return what sounded: kind, start_s, bodies; after it has ended."""
        found = json.loads((self.folder / "events.json").read_text(encoding="utf-8"))
        return [one for one in found["sounding"] if one["kind"] in ("impact", "roll", "slide")]

    def _run(self) -> None:
        try:
            microphone = ",".join(f"{x:.6g}" for x in self.microphone_m)
            self._call(
                0.1, "score", "poses.npz", "-o", "draft.wav", "--contacts", "contacts.npz", "--microphone", microphone
            )
            words = ["render", "contacts.npz", "-o", "sound.wav", "--events", "events.json"]
            self._call(0.7, *words, *(["--stems", "stems"] if self.stems else []))
            if self.cancelled:
                return
            self.sound.parent.mkdir(parents=True, exist_ok=True)
            os.replace(shutil.copy(self.folder / "sound.wav", self.sound.with_suffix(".part")), self.sound)
            if self.stems:
                kept = self.sound.with_name(self.sound.stem + "_stems")
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(self.folder / "stems", kept)
            self.fraction, self.said = 1.0, "done"
        except (BakeError, OSError) as error:
            if not self.cancelled:
                self.error = str(error)

    def _call(self, begins: float, *words: str) -> None:
        """Run one command to its end, and show its last line meanwhile."""
        if self.cancelled:
            return
        self.fraction, last = begins, ""
        self.process = subprocess.Popen(
            [*self.command, *words], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            encoding="utf-8", errors="replace", start_new_session=os.name == "posix",
        )  # fmt: skip
        assert self.process.stdout is not None
        for line in self.process.stdout:
            last = line.strip() or last
            self.said = re.sub(r"^\[\d+ s\] ", "", last)
            percent = re.search(r"(\d+) ?%", last)
            if percent:
                self.fraction = max(self.fraction, begins + 0.3 * min(int(percent[1]), 100) / 100)
        if self.process.wait() != 0 and not self.cancelled:
            raise BakeError(last.removeprefix("sonic-bullet: ") or f"sonic-bullet ended with {self.process.returncode}")
