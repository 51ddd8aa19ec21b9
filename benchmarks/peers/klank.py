"""SuperCollider's Klank: ten synths of a hundred modes each, rendered by scsynth without a sound card.

The synth definition and the score are written here byte by byte, so the server alone is needed, no language.
[SuperCollider reference: Synth Definition File Format, version 2; Non-Realtime Synthesis]
"""

from __future__ import annotations

import struct
import tempfile
from pathlib import Path

from benchmarks.peers.tools import SR, long_less_short, spread_modes, tool

PACKAGE = "supercollider-server"
MODES, SYNTHS = 100, 10
AUDIO, SCALAR = 2, 0
CONSTANT = -1


def _name(text: str) -> bytes:
    return bytes([len(text)]) + text.encode()


def _ugen(kind: str, rate: int, inputs: list[tuple[int, int]], outputs: int) -> bytes:
    """A unit. inputs: (unit, its output), or (CONSTANT, which)."""
    head = _name(kind) + struct.pack(">biih", rate, len(inputs), outputs, 0)
    return head + b"".join(struct.pack(">ii", *one) for one in inputs) + bytes([rate]) * outputs


def definition(name: str, shift: float) -> bytes:
    """Impulse.ar(10) -> Klank.ar -> Out.ar(0). shift, 0 … 1: where its frequencies lie between a whole number of
    others'.
    """
    hertz, ring_s = spread_modes(MODES)
    hertz = hertz + shift * (hertz[1] - hertz[0])
    constants = [0.0, 1.0, 10.0]
    specs: list[tuple[int, int]] = []
    for values in zip(hertz, [1 / MODES] * MODES, ring_s, strict=True):
        for value in values:
            specs.append((CONSTANT, len(constants)))
            constants.append(float(value))
    zero, one, ten = ((CONSTANT, i) for i in range(3))
    units = [
        _ugen("Impulse", AUDIO, [ten, zero], 1),
        _ugen("Klank", AUDIO, [(0, 0), one, zero, one, *specs], 1),  # input, scale, offset and decay scale, then modes
        _ugen("Out", AUDIO, [zero, (1, 0)], 0),
    ]
    body = _name(name) + struct.pack(f">i{len(constants)}f", len(constants), *constants)
    body += struct.pack(">iii", 0, 0, len(units)) + b"".join(units) + struct.pack(">h", 0)
    return b"SCgf" + struct.pack(">ih", 2, 1) + body


def _padded(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 4)


def _message(address: str, *values: bytes | str | int) -> bytes:
    """An Open Sound Control message."""
    kinds, body = ",", b""
    for value in values:
        if isinstance(value, bytes):
            kinds, body = kinds + "b", body + struct.pack(">i", len(value)) + _padded(value)
        elif isinstance(value, str):
            kinds, body = kinds + "s", body + _padded(value.encode() + b"\0")
        else:
            kinds, body = kinds + "i", body + struct.pack(">i", value)
    return _padded(address.encode() + b"\0") + _padded(kinds.encode() + b"\0") + body


def score(seconds: float) -> bytes:
    """All synths from 0 to the end, as scsynth -N reads it: bundles, each with its length before it."""
    start = [_message("/d_recv", definition(f"bank{k}", k / SYNTHS)) for k in range(SYNTHS)]
    start += [_message("/s_new", f"bank{k}", 1000 + k, 0, 0) for k in range(SYNTHS)]
    out = b""
    for time_s, messages in ((0.0, start), (seconds, [_message("/c_set", 0, 0)])):
        bundle = b"#bundle\0" + struct.pack(">Q", int(time_s * 2**32))
        bundle += b"".join(struct.pack(">i", len(one)) + one for one in messages)
        out += struct.pack(">i", len(bundle)) + bundle
    return out


def modes_sustained(scale: float = 1.0) -> float:
    """Modes that one core keeps ringing in real time. Raises MissingTool."""
    server, seconds = tool("scsynth", PACKAGE), 20 * scale
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)

        def command(length_s: float) -> list[str]:
            file = folder / f"{length_s}.osc"
            file.write_bytes(score(length_s))
            how = ["-w", "2048", "-m", "65536", "-i", "0", "-o", "1"]
            return [server, *how, "-N", file.name, "_", "sound.wav", str(SR), "WAV", "float"]

        spent = long_less_short(command, folder, seconds, repeats=3 if scale >= 1 else 1)
        if not any((folder / "sound.wav").read_bytes()[4096:8192]):
            raise RuntimeError("scsynth made no sound")
    return MODES * SYNTHS * seconds / spent
