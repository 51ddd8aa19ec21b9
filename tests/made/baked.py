"""Baked models, and one strike as the run time's own bank plays it."""

from __future__ import annotations

import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np

from sonic_bullet.apps.bake import BakedStrike
from sonic_bullet.engine.bank import ModeSet, append, empty_bank
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.files.meshes import read_own_vertices
from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry import nearest
from sonic_bullet.modal import read_mesh
from sonic_bullet.records import Air, Array, Body, ModalModel
from sonic_bullet.session.body_models import analyse_body
from tests.made.banks import Strike, advance

SR = 48_000


def solved_body(mesh: Path, material: str, scale: float = 1.0, **options: float) -> Body:
    """A mesh's body as a scene has it."""
    made = load_material(material)
    model = analyse_body((read_mesh(mesh, scale),), made, **options)
    return Body(0, -1, 0, mesh.stem, model.mass_kg, np.eye(3), model.volume_m3, material=made, model=model)


def shapes_at(model: ModalModel, body_shape: Array, index: object, point_m: Array) -> Array:
    """(p, 3, m) of what the run time would look up there."""
    face, weight, _ = nearest(index, point_m)
    return np.einsum("pc,pcxm->pxm", weight, body_shape[model.face[face]].astype(float))


def bank_strike(body: Body, strike: BakedStrike, seconds: float, sr: int = SR) -> Array:
    """Pressure of the modes at 1 m, by the bank that scenes sound by."""
    resonator = build_resonator(body, (), sr, Air())
    modes = ModeSet(resonator.omega_rad_s, resonator.decay_per_s, resonator.weight)
    bank, state = append(*empty_bank(sr, radiates=np.ones(1, bool)), [modes])
    shape = shapes_at(body.model, resonator.shape, resonator.index, strike.point_m[None])[0]
    hit = Strike(0, 0.0, strike.contact_s, strike.impulse_n_s @ shape, flat=True)
    return advance(bank, state, round(seconds * sr), [hit])[0, 0]


def own_vertices(mesh: Path) -> Array:
    return read_own_vertices(mesh)[0]


def error_db(one: Array, other: Array) -> float:
    """Energy of the difference over that of ``other``."""
    return 10 * np.log10(((one - other) ** 2).sum() / (other**2).sum() + 1e-300)


def played_by_c(header: Path, point: int, impulse: Array, contact_s: float, count: int, sr: int = SR) -> Array:
    """What the header's own bank makes of a strike, compiled with all warnings as errors."""
    name = header.stem
    source = header.with_name("play.c")
    source.write_text(
        f"""
#include <stdio.h>
#include "{header.name}"
static {name}_bank bank;
static float out[{count}];
int main(void) {{
    {name}_init(&bank, {sr});
    if (!{name}_strike(&bank, {point}, {impulse[0]!r}, {impulse[1]!r}, {impulse[2]!r}, {contact_s!r})) return 1;
    {name}_render(&bank, out, 100);
    {name}_render(&bank, out + 100, {count} - 100);
    return fwrite(out, sizeof *out, {count}, stdout) != {count};
}}
""".replace("np.float64(", "(").replace("'", "")
    )
    program = header.with_name("play")
    words = ["gcc", "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-o", program, source, "-lm"]
    subprocess.run(words, check=True, capture_output=True, text=True, timeout=60)
    return np.frombuffer(subprocess.run([program], check=True, capture_output=True, timeout=60).stdout, np.float32)


FAUST_MAIN = """
#include <stdio.h>
#include <string.h>
#define FAUSTFLOAT double
typedef struct {
    void *uiInterface;
    void (*openTabBox)(void *, const char *);
    void (*openHorizontalBox)(void *, const char *);
    void (*openVerticalBox)(void *, const char *);
    void (*closeBox)(void *);
    void (*addButton)(void *, const char *, double *);
    void (*addCheckButton)(void *, const char *, double *);
    void (*addVerticalSlider)(void *, const char *, double *, double, double, double, double);
    void (*addHorizontalSlider)(void *, const char *, double *, double, double, double, double);
    void (*addNumEntry)(void *, const char *, double *, double, double, double, double);
    void (*declare)(void *, double *, const char *, const char *);
} UIGlue;
typedef struct { void *metaInterface; void (*declare)(void *, const char *, const char *); } MetaGlue;
#include "bank.c"
static double *strike, *point, *impulse, *contact;
static void none(void *i, const char *n) { (void)i; (void)n; }
static void end(void *i) { (void)i; }
static void button(void *i, const char *n, double *z) { (void)i; (void)n; strike = z; }
static void slider(void *i, const char *n, double *z, double a, double b, double c, double d)
{ (void)i; (void)n; (void)z; (void)a; (void)b; (void)c; (void)d; }
static void entry(void *i, const char *n, double *z, double a, double b, double c, double d)
{
    (void)i; (void)a; (void)b; (void)c; (void)d;
    if (!strcmp(n, "point")) point = z; else if (!strcmp(n, "impulse")) impulse = z;
    else if (!strcmp(n, "contact")) contact = z;
}
static void said(void *i, double *z, const char *k, const char *v) { (void)i; (void)z; (void)k; (void)v; }
static double out[COUNT];
int main(void)
{
    UIGlue ui = { 0, none, none, none, end, button, button, slider, slider, entry, said };
    mydsp *dsp = newmydsp();
    initmydsp(dsp, RATE);
    buildUserInterfacemydsp(dsp, &ui);
    *point = POINT; *impulse = IMPULSE; *contact = CONTACT_MS; *strike = 1;
    double *outs[1] = { out };
    for (int i = 0; i < COUNT; i += 100) { outs[0] = out + i; computemydsp(dsp, 100, 0, outs); }
    return fwrite(out, sizeof *out, COUNT, stdout) != COUNT;
}
"""


def played_by_faust(program: Path, point: int, impulse_n_s: float, contact_s: float, count: int, sr: int = SR) -> Array:
    """What Faust makes of a strike into the surface. count: a multiple of 100."""
    folder = program.parent
    words = ["faust", "-lang", "c", "-double", "-cn", "mydsp", "-o", folder / "bank.c", program]
    subprocess.run(words, check=True, capture_output=True, text=True, timeout=120)
    (folder / "main.c").write_text(FAUST_MAIN)
    given = {"COUNT": count, "RATE": sr, "POINT": point, "IMPULSE": impulse_n_s, "CONTACT_MS": 1e3 * contact_s}
    defined = [f"-D{name}={value}" for name, value in given.items()]
    words = ["gcc", "-O1", *defined, "-o", folder / "played", folder / "main.c", "-lm"]
    subprocess.run(words, check=True, capture_output=True, text=True, timeout=120)
    return np.frombuffer(subprocess.run([folder / "played"], check=True, capture_output=True, timeout=60).stdout)


def third_octave_db(sound: Array, sr: int = SR, low_hz: float = 100.0) -> Array:
    """Energy of each third-octave from ``low_hz`` on, in dB; bands 60 dB below the loudest are NaN."""
    power = np.abs(np.fft.rfft(sound)) ** 2
    freq = np.fft.rfftfreq(len(sound), 1 / sr)
    edge = low_hz * 2 ** (np.arange(24) / 3 - 1 / 6)
    band = np.array([power[(freq >= a) & (freq < b)].sum() for a, b in pairwise(edge)])
    level = 10 * np.log10(band + 1e-300)
    return np.where(level > level.max() - 60, level, np.nan)
