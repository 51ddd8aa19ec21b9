"""BakedModel -> Faust .dsp: a bank of second-order sections, struck by a button.

    half-sine F = J π/2τ sin(at), a = π/τ, 0 < t < τ; of a mode, s = -d + iω:
    z(t) = C (e^{st} - cos at - (s/a) sin at),  C = J (1 + i d/ω) g (π/2τ) a/(a² + s²)         while it lasts
         = C (e^{st} + e^{s(t-τ)})                                                             after it
    so each mode rings free twice, from 0 and from τ, and follows the force meanwhile
    p = Re(pressure·z) + Im(pressure) F̄ g/ω          so what lasts sends nothing [src/bank/bank.hpp]
        F̄: the force's mean over a sample about each
    ring of c from sample 0:  Re(c e^{sn/sr}) = (Re c, -R (Re c cos θ + Im c sin θ)) / (1, -2 R cos θ, R²),
        R = e^{-d/sr},  θ = ω/sr
    g = -φ(p)·n̂(p): into the surface

Coefficients are made of the sample rate it runs at; modes at or above half of it are silent. Output: pascals at 1 m
over `full scale`.
"""

from __future__ import annotations

import os
import re

import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.c_bank import identifier
from sonic_bullet.apps.bake.strike_playback import (
    LONGEST_CONTACT_S,
    TAP_CONTACT_S,
    TAP_IMPULSE_N_S,
    point_normals,
    pressure_of,
)
from sonic_bullet.files.storage.atomic import replace_file

FAUST_HEAD = """\
// {modes} modes at {points} points of {material}, by sonic_bullet.
// Output: pressure at 1 m in Pa over "full scale". Needs the Faust standard libraries.
import("stdfaust.lib");
declare name "{name}";

hit = button("strike") : ba.impulsify;
point = nentry("point", {point}, 0, {last}, 1) : int;
impulse = nentry("impulse [unit:N s]", {impulse:g}, 0, 10, 0.0001) : ba.sAndH(hit);
contact = nentry("contact [unit:ms]", {contact:g}, 0, {longest:g}, 0.001) / 1000 : max(0.000001);
scale = nentry("full scale [unit:Pa]", 1, 0.000001, 1000000, 0.000001);

// the pulse: begin, end, and force while it lasts
struck = hit : max ~ _;
age = hit : (\\(x, h).(select2(h > 0, x + 1, 0))) ~ _;
length = contact * ma.SR;
a = ma.PI / contact;
begin = hit * impulse;
end = struck * (age >= length) * (age - 1 < length) * impulse;
lasts = struck * (age < length) * impulse;
sine = lasts * sin(a * age / ma.SR);
cosine = lasts * cos(a * age / ma.SR);
acted(x) = 0.5 - 0.5 * cos(a / ma.SR * max(0, min(length, x)));
force = struck * (acted(age + 0.5) - acted(age - 0.5)) * impulse * ma.SR;
late = ceil(length) - length;

mode(f, d, re, im, g) = ring - g * audible * (cr * cosine - (cr * d + ci * w) / a * sine - im / w * force)
with {{
    w = 2 * ma.PI * f;
    theta = w / ma.SR;
    audible = f < ma.SR / 2;
    r = exp(0 - d / ma.SR);
    dr = a * a + d * d - w * w;
    di = 0 - 2 * d * w;
    k = a * a / 2 / (dr * dr + di * di);
    pr = re - im * d / w;
    pi = im + re * d / w;
    cr = k * (pr * dr + pi * di);
    ci = k * (pi * dr - pr * di);
    er = exp(0 - d * late / ma.SR) * cos(theta * late);
    ei = exp(0 - d * late / ma.SR) * sin(theta * late);
    one(x, y, i) = i * x - i' * r * (x * cos(theta) + y * sin(theta));
    ring = (one(cr, ci, begin) + one(cr * er - ci * ei, cr * ei + ci * er, end)) * g * audible
        : fi.tf2(1, 0, 0, 0 - 2 * r * cos(theta), r * r);
}};

process =
"""
"""What precedes the modes, one a line: frequency, decay, pressure, and a table of g over the points."""


def write_faust_bank(path: str | os.PathLike[str], model: BakedModel) -> None:
    """Write a model as a Faust program, whole or not at all. Raises FileError, ModalError."""
    with replace_file(path) as file:
        file.write(faust_bank_text(model).encode())


def faust_bank_text(model: BakedModel) -> str:
    """Write the program's text. Raises ModalError where the model has no radiation."""
    pressure = pressure_of(model)
    gain = -np.einsum("px,pxm->mp", point_normals(model), model.shape.astype(float))
    loudest = int(np.argmax((gain**2).T @ (np.abs(pressure) ** 2 / np.maximum(model.decay_per_s, 1e-3))))
    head = FAUST_HEAD.format(
        modes=model.mode_count,
        points=len(model.point_m),
        material=re.sub(r"[\r\n]", " ", model.material.name) or "a body",
        name=identifier(model.name),
        point=loudest,
        last=len(model.point_m) - 1,
        impulse=TAP_IMPULSE_N_S,
        contact=1e3 * TAP_CONTACT_S,
        longest=1e3 * LONGEST_CONTACT_S,
    )
    lines = []
    for m in range(model.mode_count):
        table = ", ".join(_number(g, 7) for g in gain[m].tolist())
        at_point = f"(waveform{{{table}}}, point : rdtable)"
        words = (model.freq_hz[m], model.decay_per_s[m], pressure[m].real, pressure[m].imag)
        lines.append(f"    mode({', '.join(_number(float(x), 12) for x in words)}, {at_point})")
    return head + ",\n".join(lines) + "\n    :> /(scale);\n"


def _number(value: float, digits: int) -> str:
    """Format a number for Faust: never a whole one, which it would take for an integer."""
    text = f"{value:.{digits}g}"
    return text if "." in text or "e" in text else f"{text}.0"
