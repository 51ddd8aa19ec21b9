"""Csound's opcode `mode`: 400 of them in one instrument, control periods of 200 samples."""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.peers.tools import SR, long_less_short, spread_modes, tool

PACKAGE = "csound"
MODES = 400


def orchestra(seconds: float) -> str:
    """A file of Csound's: the instrument, and a score that plays it for so long."""
    hertz, ring_s = spread_modes(MODES)
    quality = 3.14159265 * hertz * ring_s / 6.9078  # of a mode that falls by 60 dB in ring_s
    lines = "\n".join(
        f"aone mode astruck, {f:.4f}, {q:.3f}\nasum = asum + aone" for f, q in zip(hertz, quality, strict=True)
    )
    return f"""<CsoundSynthesizer>
<CsOptions>
-n -d -m0
</CsOptions>
<CsInstruments>
sr = {SR}
ksmps = 200
nchnls = 1
0dbfs = 1
instr 1
asum = 0
astruck mpulse 1, 0.1
{lines}
out asum / {MODES * 1000}
endin
</CsInstruments>
<CsScore>
i 1 0 {seconds}
</CsScore>
</CsoundSynthesizer>
"""


def modes_sustained(scale: float = 1.0) -> float:
    """Modes that one core keeps ringing in real time. Raises MissingTool."""
    program, seconds = tool("csound", PACKAGE), 20 * scale
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)

        def command(length_s: float) -> list[str]:
            (folder / f"{length_s}.csd").write_text(orchestra(length_s), encoding="utf-8")
            return [program, f"{length_s}.csd"]

        spent = long_less_short(command, folder, seconds, repeats=3 if scale >= 1 else 1)
    return MODES * seconds / spent
