"""BakedModel -> C header: its numbers as tables, and a bank of resonators that plays them.

    #include "bowl.h"
    static bowl_bank bank;
    bowl_init(&bank, 48000);
    bowl_strike(&bank, point, jx, jy, jz, 1e-4);
    bowl_render(&bank, out, n);

The bank is `strike_playback` sample for sample, in double, C99 and the maths library alone. It holds a few pulses at a
time; when all are under way a strike is refused, and `_strike` returns 0.
"""

from __future__ import annotations

import os
import re

import numpy as np

from sonic_bullet._engine import NODES_PER_PULSE, NODES_PER_SAMPLE, SHORTEST_PULSE
from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.strike_playback import LONGEST_CONTACT_S, pressure_of
from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.records import Array

BANK = """\
#define NAME_PULSES 8
typedef struct { /* nodes 0: free */
    double at, spacing, length, sum, whole, j[3];
    int age, node, nodes, point;
} NAME_pulse;
typedef struct {
    double sr, re[NAME_MODES], im[NAME_MODES], turn_re[NAME_MODES], turn_im[NAME_MODES];
    NAME_pulse pulse[NAME_PULSES];
} NAME_bank;

/* Silence at sample rate sr; modes at or above sr/2 are left out. */
static void NAME_init(NAME_bank *b, double sr)
{
    memset(b, 0, sizeof *b);
    b->sr = sr;
    for (int m = 0; m < NAME_MODES; m++) {
        double r = NAME_freq_hz[m] < sr / 2 ? exp(-NAME_decay_per_s[m] / sr) : 0.0;
        b->turn_re[m] = r * cos(2 * NAME_PI * NAME_freq_hz[m] / sr);
        b->turn_im[m] = r * sin(2 * NAME_PI * NAME_freq_hz[m] / sr);
    }
}

static double NAME_force(const NAME_pulse *p, int node)
{
    return fmax(sin(NAME_PI * (node + 0.5) * p->spacing / p->length), 0);
}

/* What an impulse of the pulse, t seconds old, has made of a mode; 0 of modes that are left out. */
static void NAME_hit(const NAME_bank *b, const NAME_pulse *p, int m, double t, double impulse, double z[2])
{
    const float *s = &NAME_shape[3 * (m * NAME_POINTS + p->point)];
    double w = 2 * NAME_PI * NAME_freq_hz[m], d = NAME_decay_per_s[m];
    double g = NAME_freq_hz[m] < b->sr / 2 ? impulse * exp(-d * t) : 0;
    g *= s[0] * p->j[0] + s[1] * p->j[1] + s[2] * p->j[2];
    z[0] = g * (cos(w * t) - d / w * sin(w * t));
    z[1] = g * (sin(w * t) + d / w * cos(w * t));
}

/* All that a pulse sends by the modes, summed over the samples; nodes at one place between samples count as one. */
static double NAME_whole(const NAME_bank *b, const NAME_pulse *p, int cells)
{
    double whole = 0, z[2];
    for (int k = 0; k < cells && k < p->nodes; k++) {
        double part = 0;
        for (int i = k; i < p->nodes; i += cells) part += NAME_force(p, i) / p->sum;
        for (int m = 0; m < NAME_MODES; m++) {
            double c = 1 - b->turn_re[m], s = b->turn_im[m], re = NAME_pressure_re[m], im = NAME_pressure_im[m];
            NAME_hit(b, p, m, (1 - (k + 0.5) * p->spacing) / b->sr, part, z);
            whole += ((re * c - im * s) * z[0] - (re * s + im * c) * z[1]) / (c * c + s * s);
        }
    }
    return whole;
}

/* The part of a pulse that acts within half a sample of one. */
static double NAME_part(const NAME_pulse *p, int sample)
{
    double from = fmin(fmax((sample - 0.5) / p->length, 0), 1), to = fmin((sample + 0.5) / p->length, 1);
    return (cos(NAME_PI * from) - cos(NAME_PI * to)) / 2;
}

/* Impulse j in N s at a point, as a half-sine of contact_s seconds from the next sample on; 0 where none is free. */
static int NAME_strike(NAME_bank *b, int point, double jx, double jy, double jz, double contact_s)
{
    if (point < 0 || point >= NAME_POINTS || !(contact_s >= 0 && contact_s <= NAME_LONGEST_S)) return 0;
    for (int k = 0; k < NAME_PULSES; k++) {
        NAME_pulse *p = &b->pulse[k];
        if (p->nodes) continue;
        double length = fmax(contact_s * b->sr, NAME_SHORTEST);
        double cells = fmax(NAME_PER_SAMPLE, ceil(NAME_NODES / length)); /* of a sample, a node in the middle of each */
        p->nodes = (int)ceil(cells * length); p->length = length;
        p->spacing = 1 / cells; p->at = p->spacing / 2; p->node = 0; p->point = point;
        p->j[0] = jx; p->j[1] = jy; p->j[2] = jz; p->sum = 0;
        for (int i = 0; i < p->nodes; i++) p->sum += NAME_force(p, i);
        p->age = 0; p->whole = NAME_whole(b, p, (int)fmin(cells, p->nodes));
        return 1;
    }
    return 0;
}

/* The next n samples: pressure at 1 m, in Pa. */
static void NAME_render(NAME_bank *b, float *out, int n)
{
    for (int i = 0; i < n; i++) {
        double y = 0, z[2];
        for (int m = 0; m < NAME_MODES; m++) {
            double re = b->re[m] * b->turn_re[m] - b->im[m] * b->turn_im[m];
            b->im[m] = b->re[m] * b->turn_im[m] + b->im[m] * b->turn_re[m];
            b->re[m] = re;
        }
        for (int k = 0; k < NAME_PULSES; k++) {
            NAME_pulse *p = &b->pulse[k];
            if (p->nodes) y -= p->whole * NAME_part(p, p->age++);
            for (; p->node < p->nodes && p->at <= 0; p->node++, p->at += p->spacing) {
                double part = NAME_force(p, p->node) / p->sum;
                for (int m = 0; m < NAME_MODES; m++) {
                    NAME_hit(b, p, m, -p->at / b->sr, part, z);
                    b->re[m] += z[0];
                    b->im[m] += z[1];
                }
            }
            if (p->node < p->nodes) p->at -= 1; else p->nodes = p->node = 0;
        }
        for (int m = 0; m < NAME_MODES; m++) y += NAME_pressure_re[m] * b->re[m] - NAME_pressure_im[m] * b->im[m];
        out[i] = (float)y;
    }
}
"""


def write_c_bank(path: str | os.PathLike[str], model: BakedModel) -> None:
    """Write a model as a C header, whole or not at all. Raises FileError, ModalError."""
    with replace_file(path) as file:
        file.write(c_bank_text(model).encode())


def c_bank_text(model: BakedModel) -> str:
    """Write the header's text. Raises ModalError where the model has no radiation."""
    name, pressure = identifier(model.name), pressure_of(model)
    guard = f"{name.upper()}_MODAL_BANK_H"
    material = re.sub(r"\*/|[\r\n]", " ", model.material.name)
    tables = (
        _table("double", f"{name}_freq_hz", model.freq_hz),
        _table("double", f"{name}_decay_per_s", model.decay_per_s),
        _table("double", f"{name}_pressure_re", pressure.real),
        _table("double", f"{name}_pressure_im", pressure.imag),
        _table("float", f"{name}_point_m", model.point_m.astype(np.float32)),
        _table("float", f"{name}_shape", model.shape.transpose(2, 0, 1)),
    )
    head = (
        f"/* {name}: {model.mode_count} modes at {len(model.point_m)} points of {material or 'a body'}; sonic_bullet.\n"
        "   Hz, 1/s with radiation, Pa m at 1 m per modal velocity, m, 1/sqrt(kg); shape[mode][point][xyz]. */\n"
        f"#ifndef {guard}\n#define {guard}\n#include <math.h>\n#include <string.h>\n\n"
        f"#define {name}_MODES {model.mode_count}\n#define {name}_POINTS {len(model.point_m)}\n"
        f"#define {name}_NODES {NODES_PER_PULSE}\n#define {name}_PER_SAMPLE {NODES_PER_SAMPLE}\n"
        f"#define {name}_SHORTEST {SHORTEST_PULSE}\n#define {name}_LONGEST_S {LONGEST_CONTACT_S}\n"
        f"#define {name}_PI 3.14159265358979323846\n"
    )
    return head + "\n".join(tables) + "\n" + BANK.replace("NAME_", f"{name}_") + f"\n#endif /* {guard} */\n"


def identifier(name: str) -> str:
    """Make a name that C and Faust accept."""
    reserved = frozenset(
        re.findall(
            r"\w+",
            "auto break case char const continue default do double else enum extern float for goto if inline int long "
            "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile "
            "while",
        )
    )
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower()
    return plain if plain and not plain[0].isdigit() and plain not in reserved else f"body_{plain}".rstrip("_")


def _table(kind: str, name: str, values: Array) -> str:
    """Write an array in C, in digits that give the same number back."""
    a_line = 8
    flat = values.ravel()
    digits = 17 if kind == "double" else 9
    words = [f"{value:.{digits}g}" for value in flat.tolist()]
    rows = [", ".join(words[i : i + a_line]) for i in range(0, len(words), a_line)]
    return f"static const {kind} {name}[{len(flat)}] = {{\n" + ",\n".join(rows) + "\n};"
