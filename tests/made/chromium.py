"""A headless Chromium, spoken to over a pipe in the Chrome DevTools Protocol, without a library for it.

command {"id", "method", "params"} + NUL -> fd 3 of the browser        fd 4 -> replies and events, each ended by NUL
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome", "chromium-headless-shell", "chrome-headless-shell")
PATIENCE_S = 60.0
WIRED = """import fcntl, os, sys
one, other = (fcntl.fcntl(int(x), fcntl.F_DUPFD, 10) for x in sys.argv[1:3])
os.dup2(one, 3), os.dup2(other, 4), os.execv(sys.argv[3], sys.argv[3:])"""


def chromium() -> str | None:
    """Where one is; None: nowhere on PATH."""
    return next((place for place in map(shutil.which, NAMES) if place), None)


class Browser:
    """One page of a browser. errors: what its console complained of; asked: addresses that it went to."""

    def __init__(self, program: str, home: Path) -> None:
        down, up = os.pipe(), os.pipe()
        words = [program, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe"]
        words += ["--enable-unsafe-swiftshader", "--window-size=1280,900"]  # 3D without a graphics card
        words += [f"--user-data-dir={home}", "--no-first-run", "--disable-background-networking", "about:blank"]
        wired = [sys.executable, "-c", WIRED, str(down[0]), str(up[1]), *words]
        self._process = subprocess.Popen(
            wired, pass_fds=(down[0], up[1]), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(down[0])
        os.close(up[1])
        self._to, self._from, self._count, self._rest = down[1], up[0], 0, b""
        self.errors: list[str] = []
        self.asked: list[str] = []
        self._loaded = False
        self._session: dict[str, str] = {}
        target = self.do("Target.createTarget", url="about:blank")["targetId"]
        self._session = {"sessionId": self.do("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]}
        for room in ("Page", "Runtime", "Log", "Network"):
            self.do(f"{room}.enable")

    def do(self, method: str, **params: Any) -> Any:
        """What the browser answers."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": params, **self._session}
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (found := self._next()).get("id") != self._count:
            pass
        assert "error" not in found, found
        return found["result"]

    def go(self, page: Path) -> None:
        """Open a file."""
        self._loaded = False
        self.do("Page.navigate", url=page.as_uri())
        while not self._loaded:
            self._next()

    def value(self, script: str, *, touched: bool = True) -> Any:
        """What a script in the page comes to, as if the user had touched something, or not."""
        found = self.do(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True, userGesture=touched
        )
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def until(self, script: str, *, touched: bool = True) -> Any:
        """The script's value once it is true."""
        end = time.monotonic() + PATIENCE_S
        while not (found := self.value(script, touched=touched)):
            assert time.monotonic() < end, script
            time.sleep(0.05)
        return found

    def picture(self, place: Path, *, whole: bool = True) -> None:
        """A screenshot of the whole page, or of what the window shows of it."""
        # what a script has drawn is on the screen a frame later
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")
        made = self.do("Page.captureScreenshot", captureBeyondViewport=whole)["data"]
        place.write_bytes(base64.b64decode(made))

    def script_ms(self) -> float:
        """Processor time of the page's scripts so far, ms; after Performance.enable in threadTicks."""
        metrics = self.do("Performance.getMetrics")["metrics"]
        return float(1000 * next(one["value"] for one in metrics if one["name"] == "ScriptDuration"))

    def page_processor_s(self) -> float:
        """Processor time that pages have taken, all threads, s: what else a machine does is not in it."""
        parent: dict[int, int] = {}
        for place in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                parent[int(place.parent.name)] = int(place.read_text().rsplit(")", 1)[1].split()[1])
        mine, total = {self._process.pid}, 0
        while more := {child for child, of in parent.items() if of in mine} - mine:
            mine |= more
        for one in mine:
            with contextlib.suppress(OSError):
                if b"--type=renderer" in Path(f"/proc/{one}/cmdline").read_bytes():
                    stat = Path(f"/proc/{one}/stat").read_text().rsplit(")", 1)[1].split()
                    total += int(stat[11]) + int(stat[12])
        return total / os.sysconf("SC_CLK_TCK")

    def end(self) -> None:
        """Close it."""
        self._process.kill()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)

    def _next(self) -> Any:
        while b"\0" not in self._rest:
            assert select.select([self._from], [], [], PATIENCE_S)[0], "the browser says nothing"
            read = os.read(self._from, 1 << 20)
            assert read, "the browser is gone"
            self._rest += read
        line, self._rest = self._rest.split(b"\0", 1)
        found = json.loads(line)
        self._note(found.get("method"), found.get("params", {}))
        return found

    def _note(self, method: str | None, about: Any) -> None:
        self._loaded |= method == "Page.loadEventFired"
        if method == "Network.requestWillBeSent":
            self.asked.append(about["request"]["url"][:80])
        if method == "Runtime.exceptionThrown":
            self.errors.append(str(about["exceptionDetails"]))
        if method == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning"):
            self.errors.append(str(about["args"]))
        if (
            method == "Log.entryAdded"
            and about["entry"]["level"] in ("error", "warning")
            and "GL Driver Message" not in about["entry"]["text"]  # drawn without a graphics card, and said so
        ):
            self.errors.append(about["entry"]["text"])


@contextlib.contextmanager
def opened_page(page: Path, home: Path) -> Iterator[Browser]:
    """The page in a browser whose profile is ``home``; skips the test where there is no browser."""
    program = chromium()
    if program is None:
        pytest.skip("no Chromium on PATH")
    browser = Browser(program, home)
    try:
        browser.go(page)
        yield browser
    finally:
        browser.end()
