"""A rendering in a process of its own: `python -m tests.made.renderings LOG` prints a digest of each sensor's samples.

Beside them it prints what the process computes with, so that a test knows that what it asked for took effect.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
from dataclasses import replace

import numpy as np

import sonic_bullet as sb
from sonic_bullet import _engine
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import read_log
from sonic_bullet.records import MicrophonePath, ModalSum, Sensor, Vibrometer
from tests.made import heads

PATH = MicrophonePath(
    [0.0, 0.1, 0.3],
    [[0.3, -0.5, 0.2], [-0.3, -0.4, 0.4], [0, 1, 0.3]],
    [[0, 0, 0, 1], [0, 0, 0.6, 0.8], [0.1, 0, 0.7, 0.7]],
)
PLACE = (0.2, -0.6, 0.3)


def sensors() -> dict[str, tuple[Sensor, ...]]:
    """What hears, by name."""
    return {
        "two microphones": (sb.Microphone(PLACE), sb.Microphone((-0.4, 0.3, 0.5))),
        "moved by a path, by a body": (sb.Microphone(path=PATH), sb.Microphone((0.02, 0, 0.4), body_id=1)),
        "ambisonics that turn": (sb.Ambisonics(path=PATH, order=2),),
        "ears": (sb.Binaural(PLACE, head=heads.head(direction=heads.directions(30), taps=64)),),
        "directivity": (sb.Microphone(PLACE, directivity=True),),
        "vibrometer, sum of modes": (Vibrometer(1, [0.01, 0.01, 0.02], [0, 0.6, 0.8]), ModalSum(1.0)),
    }


def main(path: str) -> None:
    """Render a log by each of `sensors` and print what came of it as JSON."""
    from threadpoolctl import threadpool_info

    log = read_log(path)
    digest = {}
    for name, those in sensors().items():
        # without a residual many steps are rendered at once
        sound = render_log(replace(log, sensors=those, residual="by a path" in name or "microphones" in name))
        assert np.isfinite(sound).all() and (sound**2).sum(axis=1).all(), f"{name}: it is silent"
        digest[name] = hashlib.sha256(sound.tobytes()).hexdigest()
    x = np.linspace(0.1, 30, 20_000)
    libm = [f(one) for f in (math.sin, math.exp, math.log) for one in x.tolist()]
    blas = next((one for one in threadpool_info() if one["user_api"] == "blas"), {})
    facts = {
        "vector level": _engine.vector_level(),
        "libm": hashlib.sha256(np.array(libm).tobytes()).hexdigest(),
        "numpy": hashlib.sha256(((x + 0.3j) * (0.7 + 1j * x)).tobytes()).hexdigest(),
        "blas": blas.get("architecture"),
        "threads": blas.get("num_threads"),
    }
    print(json.dumps({"sound": digest, "facts": facts}))


if __name__ == "__main__":
    main(sys.argv[1])
