"""The practical limit: a bank in C whose sums stay in registers, in float32, state in double, no input, one signal.

    y[16 q + r] = Σ_modes Re(u s^q p^r),   s = p^16,   q 0 … 12, r 0 … 15: 208 samples, 200 of them used

Powers of each pole are tables made beforehand. It takes no forces or strikes and knows one body: what a bank could do
if it did nothing else.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.peers.tools import SR, run, tool

PACKAGE = "gcc"
MODES, FRAME = 2_000, 200

SOURCE = """
#include <math.h>
#include <stdio.h>
#include <time.h>
#define ROWS 13
typedef float row_t __attribute__((vector_size(64)));
typedef struct { row_t rowRe, rowIm, columnRe, columnIm; } Powers;
static Powers powers[MODES];
static double re[MODES], im[MODES], turnRe[MODES], turnIm[MODES];

__attribute__((noinline)) static void frame(float *out) {  /* else only what is printed would be computed */
    row_t sum[ROWS] = {{0}};
    for (int m = 0; m < MODES; m++) {
        const Powers *p = powers + m;
        float x = re[m], y = im[m];
        union { row_t all; float one[16]; } a, b;
        a.all = x * p->columnRe - y * p->columnIm;
        b.all = -(x * p->columnIm + y * p->columnRe);
        row_t c = p->rowRe, s = p->rowIm;
        for (int q = 0; q < ROWS; q++) sum[q] += a.one[q] * c + b.one[q] * s;
        double turned = re[m] * turnRe[m] - im[m] * turnIm[m];
        im[m] = re[m] * turnIm[m] + im[m] * turnRe[m];
        re[m] = turned;
    }
    __builtin_memcpy(out, sum, FRAME * sizeof(float));
}

int main(void) {
    for (int m = 0; m < MODES; m++) {
        double turn = 6.283185307179586 * (50 + 18000.0 * m / MODES) / RATE, decay = 0.5 / RATE;
        for (int k = 0; k < 16; k++) {
            powers[m].rowRe[k] = exp(-decay * k) * cos(turn * k);
            powers[m].rowIm[k] = exp(-decay * k) * sin(turn * k);
            powers[m].columnRe[k] = exp(-decay * 16 * k) * cos(turn * 16 * k);
            powers[m].columnIm[k] = exp(-decay * 16 * k) * sin(turn * 16 * k);
        }
        turnRe[m] = exp(-decay * FRAME) * cos(turn * FRAME);
        turnIm[m] = exp(-decay * FRAME) * sin(turn * FRAME);
    }
    float out[FRAME];
    double best = 1e9, total = 0;
    for (int turn = 0; turn < 5; turn++) {
        for (int m = 0; m < MODES; m++) re[m] = 1, im[m] = 0;
        clock_t begin = clock();
        for (int k = 0; k < FRAMES; k++) { frame(out); total += out[k % FRAME]; }
        double spent = (double)(clock() - begin) / CLOCKS_PER_SEC;
        if (turn > 0 && spent < best) best = spent;
    }
    printf("%.9g %.3g\\n", best, total);
    return 0;
}
"""


def modes_sustained(scale: float = 1.0) -> float:
    """Modes that one core keeps ringing in real time. Raises MissingTool."""
    compiler = tool("cc", PACKAGE)
    frames = max(1, int(1000 * scale))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "tile.c").write_text(SOURCE, encoding="utf-8")
        sizes = [f"-DRATE={SR}", f"-DMODES={MODES}", f"-DFRAME={FRAME}", f"-DFRAMES={frames}"]
        run([compiler, "-O3", "-march=native", *sizes, "tile.c", "-o", "tile", "-lm"], folder)
        spent = float(run([str(folder / "tile")], folder).split()[0])
    return MODES * frames * FRAME / SR / max(spent, 1e-9)
