"""Faust's `pm.modalModel` of a hundred modes, compiled scalar and in vectors of 32 samples: the faster of both.

Faust's own compile time grows fast with the number of modes: beyond a few hundred it takes minutes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.peers.tools import SR, run, spread_modes, tool

PACKAGE = "faust"
MODES, FRAME = 100, 200
WAYS = (("-scal",), ("-vec", "-lv", "1", "-vs", "32"))

HOST = """
#include <cstdio>
#include <ctime>
struct Meta { void declare(const char*, const char*) {} };
struct UI { void openVerticalBox(const char*) {} void closeBox() {} };
struct dsp { virtual ~dsp() {} };
#define FAUSTFLOAT float
#include "bank.h"
int main() {
    static Bank bank;
    bank.init(RATE);
    static float in[FRAME], out[FRAME];
    float *inputs[1] = {in}, *outputs[1] = {out};
    double best = 1e9, sum = 0;
    for (int turn = 0; turn < 4; turn++) {
        clock_t begin = clock();
        for (int k = 0; k < FRAMES; k++) {
            in[0] = k % 24 == 0;
            bank.compute(FRAME, inputs, outputs);
            sum += out[k % FRAME];
        }
        double spent = double(clock() - begin) / CLOCKS_PER_SEC;
        if (turn > 0 && spent < best) best = spent;
    }
    printf("%.9g %.3g\\n", best, sum);
}
"""


def program() -> str:
    """The bank in Faust."""
    hertz, ring_s = spread_modes(MODES)

    def listed(values: object) -> str:
        return "(" + ", ".join(f"{value:.5f}" for value in values) + ")"  # type: ignore[attr-defined]

    gains = listed([1 / MODES] * MODES)
    return f'import("stdfaust.lib");\nprocess = pm.modalModel({MODES}, {listed(hertz)}, {listed(ring_s)}, {gains});\n'


def modes_sustained(scale: float = 1.0) -> float:
    """Modes that one core keeps ringing in real time. Raises MissingTool."""
    faust, compiler = tool("faust", PACKAGE), tool("g++", "g++")
    frames = max(1, int(2000 * scale))
    best = 0.0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "bank.dsp").write_text(program(), encoding="utf-8")
        (folder / "host.cpp").write_text(HOST, encoding="utf-8")
        sizes = [f"-DRATE={SR}", f"-DFRAME={FRAME}", f"-DFRAMES={frames}"]
        for how in WAYS if scale >= 1 else WAYS[:1]:
            run([faust, *how, "-lang", "cpp", "-cn", "Bank", "bank.dsp", "-o", "bank.h"], folder)
            run([compiler, "-O3", "-march=native", "-ffast-math", "-w", *sizes, "host.cpp", "-o", "host"], folder)
            spent = float(run([str(folder / "host")], folder).split()[0])
            best = max(best, MODES * frames * FRAME / SR / max(spent, 1e-9))
    return best
