"""A fit as a preset: what the run time plays, with where it comes from."""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.damping_law.damping_form import Damping
from sonic_bullet.effects.presets_of_effects import to_preset
from sonic_bullet.effects.recorded_lines import MOST_LINES, RecordedLines
from sonic_bullet.files.presets import (
    DAMPING_TAKEN,
    PRESET_FORMAT,
    Elasticity,
    Preset,
    Provenance,
    Restitution,
    Surface,
    load_material,
    material_names,
)
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.typical_strike import typical_strike

FITTED_NAMES = ("alpha_per_s", "beta_s", "gamma_m2_s2", "sigma", "poisson_ratio")


def spreads(found: CaseFit) -> dict[str, float | None]:
    """Return standard errors in the parameters' own units, None where not identifiable."""
    sd = np.sqrt(np.diag(found.fit.covariance))
    value = (found.fit.alpha_per_s, found.fit.beta_s, found.fit.gamma_m2_s2, found.fit.sigma, 1.0)
    return {name: float(s * v) if np.isfinite(s) else None for name, s, v in zip(FITTED_NAMES, sd, value, strict=True)}


def recorded_lines(found: CaseFit) -> RecordedLines | None:
    """Return the lines of an object as struck on average, where no line is known to be a mode of a shape.

    None where the modes of a mesh say more, or where there is no line.
    """
    if found.objects and np.isfinite(found.fit.covariance[2, 2]):
        return None
    lines = max((e.lines for e in found.evidence), key=lambda e: len(e.freq_hz), default=None)
    if lines is None or not len(lines.freq_hz):
        return None
    typical = typical_strike(lines)
    size = np.abs(typical.at_peak)
    loud = np.argsort(-(size**2 / np.maximum(typical.decay_per_s, 1e-300)), kind="stable")
    keep = np.sort(loud[size[loud] > 0][:MOST_LINES])
    if not len(keep):
        return None
    columns = typical.freq_hz, typical.decay_per_s, size, typical.spread_db
    return RecordedLines(*(tuple(float(f"{x:.7g}") for x in column[keep]) for column in columns))


def preset_of(found: CaseFit) -> Preset:
    """Return the preset of a fit.

    Surface and impact are no part of what modes tell: they are the guess's, or steel's for a guess without a name.
    """
    fit = found.fit
    guess = found.evidence[0].thing.material if found.evidence else None
    sd = np.diag(fit.covariance)
    youngs, poisson, assumed = found.youngs_pa, fit.poisson_ratio, found.assumed
    if np.isnan(sd[2]) and found.objects:  # what the fit does not tell must not sound as if it did
        own = found.objects[0].evidence.guess
        youngs, poisson, assumed = own.youngs_pa, own.poisson, (*assumed, "youngs_pa and poisson (from the guess)")
    known = guess is not None and guess.lower() in material_names()
    base = load_material(guess.lower() if known and guess is not None else "steel")
    alpha, beta, total = fit.alpha_per_s, fit.beta_s, found.radiation == "damping"
    # one of the two alone may be told: then both are fitted, for the pair is what meets the decays
    if np.isnan(sd[:2]).all() and base.alpha_per_s is not None and base.beta_s is not None:
        alpha, beta, total, assumed = (
            base.alpha_per_s,
            base.beta_s,
            base.includes_radiation,
            (*assumed, f"{DAMPING_TAKEN}{base.name}')"),
        )
    lines = recorded_lines(found)
    if lines is not None:
        assumed = (*assumed, "level (that of the body that plays the lines: the recordings' gain is not known)")
    parameters = dict(
        zip(FITTED_NAMES, (fit.alpha_per_s, fit.beta_s, fit.gamma_m2_s2, fit.sigma, fit.poisson_ratio), strict=True)
    )
    if not found.has_material:
        assumed = (*assumed, "elasticity and density (steel's: neither a shape nor a material is given)")
        parameters = {name: parameters[name] for name in ("alpha_per_s", "beta_s")}
    source = f"fitted: {found.case.name}"
    taken = f"taken from '{base.name}'"
    used = {o.evidence.thing.name: o for o in found.objects}
    recordings = [r.file.name if r.file is not None else "features" for r in found.case.recordings if r.split == "fit"]
    return Preset(
        format=PRESET_FORMAT,
        name=f"{guess or 'fitted'} ({found.case.name})"[:100],
        density_kg_m3=found.density_kg_m3,
        elasticity=Elasticity(
            youngs_pa=youngs, poisson=float(np.clip(poisson, -0.99, 0.499)), source=source, note="; ".join(assumed)
        ),
        damping=Damping(alpha_per_s=alpha, beta_s=beta, includes_radiation=total, source=source),
        surface=Surface(roughness_m=base.roughness_m, hurst=base.hurst, source=taken),
        impact=Restitution(restitution=base.restitution, source=taken),
        effects=() if lines is None else (to_preset(lines),),
        provenance=Provenance(
            method="modes paired with damped sinusoids of maximum likelihood; least squares",
            recordings=tuple(recordings),
            parameters=parameters,
            spreads=spreads(found),
            assumed=assumed,
            verdict=fit.verdict,
            correction={name: tuple(float(c) for c in np.round(o.correction, 7)) for name, o in used.items()},
        ),
    )
