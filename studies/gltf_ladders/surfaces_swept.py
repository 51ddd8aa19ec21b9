"""Ladders of what slides and rolls: what the draft predicts of each, and what is measured here."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.roughness import WAVE_M
from studies.gltf_ladders.observed import SR, Observed
from studies.gltf_ladders.verdicts import AGREES, DIFFERS, ERRS, LACKING, PARTLY, Verdict, within

Scenes = Mapping[str, Observed]
SHOCKS = (
    "The draft lets a face ride on N = N₀ exp(δ/u₀), of stiffness N/u₀ with u₀ ∝ rms height [Persson 2007]. Then "
    "force over load depends on speed and roughness by v√u₀ alone, and the level's exponent of speed is twice that of "
    "roughness. Measured are 0.63 to 1.16 of roughness and 0.5 to 0.96 of speed (`studies/rolling_laws.py`). Rough "
    "flat faces under light load sound by shocks between asperities, of a deformation that is negligible against the "
    "roughness [Ben Abdelounis et al. 2010, whom the draft lists]. So do ours: flights and shocks are counted, which "
    "go by load, mass and the bulk's stiffness. The draft's "
    "later text no longer takes the exponential for the force: a mean has no shocks in it"
)


def contact_pitch(scenes: Scenes) -> Verdict:
    """Find rates at three masses."""
    rates, flight = [scenes[key].contact_rate_hz() for key in "abc"], [scenes[key].flight() for key in "abc"]
    return Verdict(
        "the contact's rate does not depend on mass",
        f"{rates[0]:.0f}, {rates[1]:.0f}, {rates[2]:.0f} Hz at 5 g, 0.5, 50 kg, with {100 * flight[0]:.0f}, "
        f"{100 * flight[1]:.0f}, {100 * flight[2]:.0f} % of the time in flight",
        AGREES if max(rates) < 1.2 * min(rates) else ERRS if min(flight[:2]) > 0.5 else DIFFERS,
        SHOCKS + ". At 50 kg ours rides: there its stiffness should be the draft's, and is that of one blunt cap",
    )


def finish_ladder(scenes: Scenes) -> Verdict:
    """Find rates on three finishes."""
    rates = [scenes[key].contact_rate_hz() for key in "abc"]
    power = np.log(rates[2] / rates[0]) / np.log(1e3)
    return Verdict(
        "the contact's rate goes as roughness^(-1/2)",
        f"{rates[0]:.0f}, {rates[1]:.0f}, {rates[2]:.0f} Hz: roughness^{power:.2f} over both rungs",
        AGREES if within(power, -0.5, 0.1) else ERRS if rates[0] > rates[1] > rates[2] else DIFFERS,
        "As ContactPitch. Rougher faces strike at a lower rate because they fly longer; the polished one rides, at the "
        "rate of its waves",
    )


def shock_rate(scenes: Scenes) -> Verdict:
    """Find rates over three correlation lengths."""
    rates, lengths = [scenes[key].contact_rate_hz() for key in "abc"], (1e-3, 2e-4, 5e-5)
    crossings = [0.1 * crossings_per_m(one) for one in lengths]
    off = [rate / one for rate, one in zip(rates, crossings, strict=True)]
    listed = ", ".join(f"{rate:.0f}" for rate in rates)
    return Verdict(
        "shocks at v/ℓ: 100, 500, 2000 a second",
        f"{listed} contacts a second: {off[0]:.2f}, {off[1]:.2f}, {off[2]:.2f} of the upcrossings of the waves that we "
        f"have, {crossings[0]:.0f}, {crossings[1]:.0f}, {crossings[2]:.0f}",
        ERRS if max(abs(np.log(off))) < np.log(1.5) and rates[0] < rates[1] < rates[2] else DIFFERS,
        "v/ℓ counts the longest waves alone. A profile crosses its mean √(m₂/m₀)/2π times a metre [Rice 1944; Nayak "
        "1971, whom the draft cites for its densities]: of the draft's own spectrum, from ℓ down to ℓ/16, 2.1 times "
        "an ℓ. Waves under 9 µm are left out here, which counts in the finest scene",
    )


def crossings_per_m(correlation_m: float, slope: float = -2.4, finest_m: float = 1.0 / 16) -> float:
    """Upcrossings of the mean a metre of a finish's octaves: √(m₂/m₀)/2π, m₂/m₀ the mean square of 2π/λ [Rice 1944].

    finest_m: λs, as a share of ℓ; waves that the octaves leave out count neither.
    """
    top = min(1.0 / (finest_m * correlation_m), float(np.sqrt(2) / WAVE_M[-1]))
    frequency = np.geomspace(1e-3 / correlation_m, top, 4000)
    power = np.where(frequency * correlation_m < 1, 1.0, (frequency * correlation_m) ** slope)
    return float(np.sqrt(np.trapezoid(power * frequency**2, frequency) / np.trapezoid(power, frequency)))


def sliding_pair(scenes: Scenes) -> Verdict:
    """Find levels with the roughness on either side."""
    even, swept, unswept = (scenes[key].level_db() for key in "abc")
    return Verdict(
        "only a surface that is travelled along sounds",
        f"rough and swept {swept:.1f} dB, rough and not swept {unswept:.1f} dB, both machined {even:.1f} dB",
        AGREES if swept > even > unswept + 10 else DIFFERS,
    )


def friction_ladder(scenes: Scenes) -> Verdict:
    """Find the direction of the contact force while all slide."""
    wanted = (0.0, 0.025, 0.075)  # of the pair: the average of both bodies'
    found = [_tangential_share(scenes[key], 0.3, 0.6) for key in "abc"]
    levels = [scenes[key].level_db(0.1, 0.5) for key in "abc"]
    near = all(abs(one - want) < 0.002 for one, want in zip(found, wanted, strict=True))
    return Verdict(
        "traction along the slip in proportion to friction: 0, 0.025, 0.075 of the pair",
        "tangential over normal drive " + ", ".join(f"{x:.4f}" for x in found)
        + "; levels " + ", ".join(f"{x:.1f}" for x in levels) + " dB, as the gripped ones slow down",
        AGREES if near else DIFFERS,
    )  # fmt: skip


def _tangential_share(scene: Observed, start_s: float, end_s: float) -> float:
    total = np.zeros(2)
    for at, step in zip(scene.log.start_s, scene.log.steps, strict=True):
        if start_s <= at < end_s and len(step.contacts.a):
            normal = np.einsum("kx,kx->k", step.contacts.impulse_n_s, step.contacts.normal)
            along = step.contacts.impulse_n_s - normal[:, None] * step.contacts.normal
            total += np.linalg.norm(along.sum(axis=0)), np.abs(normal.sum())
    return float(total[0] / total[1])


def face_vs_point(scenes: Scenes) -> Verdict:
    """Find how patches grow with load."""
    face, point = scenes["a"], scenes["b"]
    growth = [scene.patch_growth() for scene in (face, point)]
    ball = within(growth[1], 1 / 3, 0.1)
    return Verdict(
        "the box's patch is fixed by its face, the ball's grows with load",
        f"in what slides the box's grows with load^{growth[0]:.2f}, the ball's with load^{growth[1]:.2f}: radii of "
        f"curvature {face.radius_m:.3f}, {point.radius_m:.3f} m; {face.level_db():.1f}, {point.level_db():.1f} dB",
        AGREES if ball and abs(growth[0]) < 0.05 else ERRS if ball and within(growth[0], 1 / 3, 0.1) else DIFFERS,
        "A flat punch keeps its radius [Johnson 1985, eq. 3.36], but these faces are not flat: they have the draft's "
        "waviness, 2 µm over 2 mm. Below a mean pressure of πE*Δ/λ, here 250 MPa, wavy faces touch on their crests "
        "alone, by Hertz' law [Johnson 1985, sec. 13.2]; this box presses with 1 kPa. The draft's own later text lets "
        "the region that bears grow with load, too",
    )


def rolling_vs_sliding(scenes: Scenes) -> Verdict:
    """Find sweeps and slips."""
    (rolls, slips), (slides, _), (locked, _) = (_sweeps(scenes[key]) for key in "abc")
    levels = [scenes[key].level_db() for key in "abc"]
    ratio = min(locked) / max(locked)
    return Verdict(
        "rolling does not slip and sounds; sliding sweeps the ground alone; a large ball's sweeps are one",
        f"rolling sweeps {rolls[0]:.3f} and {rolls[1]:.3f} m/s, slips {slips:.4f}, {levels[0]:.1f} dB; sliding sweeps "
        f"{max(slides):.3f} and {min(slides):.3f} m/s, {levels[1]:.1f} dB; locked {ratio:.4f} of each other",
        AGREES
        if slips < 0.005 and levels[0] > 0 and min(slides) < 0.1 * max(slides) and within(ratio, 1, 0.02)
        else PARTLY,
    )


def _sweeps(scene: Observed) -> tuple[Array, float]:
    """Find mean sweeps (2,) and slip in m/s, by load, from 0.3 s on."""
    total, sweep, slip = 0.0, np.zeros(2), 0.0
    for at, step in zip(scene.log.start_s, scene.log.steps, strict=True):
        if at >= 0.3 and len(step.contacts.a):
            load = np.abs(np.einsum("kx,kx->k", step.contacts.impulse_n_s, step.contacts.normal))
            total += load.sum()
            sweep += load @ step.contacts.sweep_m_s
            slip += load @ np.linalg.norm(step.contacts.slip_m_s, axis=1)
    return sweep / total, slip / total


def bounce_onset(scenes: Scenes) -> Verdict:
    """Find levels and flight at three speeds."""
    levels, flight = [scenes[key].level_db() for key in "abc"], [scenes[key].flight() for key in "abc"]
    return Verdict(
        "from a quiet ride to trains of bounces as speed rises",
        ", ".join(f"{x:.1f} dB" for x in levels) + " with " + ", ".join(f"{100 * x:.0f} %" for x in flight)
        + " of the time in flight, at 0.02, 0.1, 0.7 m/s",
        AGREES if flight[0] < 0.1 < flight[2] else PARTLY,
        "",
    )  # fmt: skip


def landing(scenes: Scenes) -> Verdict:
    """Find pulses on two finishes."""
    machined, cast = (scenes[key].strongest.length_s for key in "ab")
    return Verdict(
        "the finish sets each landing's contact time",
        f"{1e6 * machined:.1f} and {1e6 * cast:.1f} µs",
        AGREES if cast > 1.05 * machined else DIFFERS,
        "",
    )


def measured_profile(scenes: Scenes) -> Verdict:
    """Render a stored track and its statistics with another seed."""
    stored, made = scenes["a"], scenes["b"]
    levels = stored.level_db(), made.level_db()
    same = [np.array_equal(scene.pressure_pa, scene.with_seed_pa(1)) for scene in (stored, made)]
    return Verdict(
        "a stored track is the same sample for sample; its statistics sound alike",
        f"with another seed the stored track is {'the same' if same[0] else 'another'}, its statistics "
        f"{'the same' if same[1] else 'another'}; {levels[0]:.1f} and {levels[1]:.1f} dB",
        AGREES if same == [True, False] and abs(levels[0] - levels[1]) < 3 else PARTLY,
    )


def pressed_ring(scenes: Scenes) -> Verdict:
    """Find decays at three frictions."""
    decays = [_t60_s(scenes[key]) for key in "abc"]
    return Verdict(
        "decay shortens as grip grows, by micro-slip",
        "T60 " + ", ".join(f"{1e3 * x:.0f}" for x in decays) + " ms at 0, 0.3, 0.9",
        AGREES if decays[0] > 1.05 * decays[1] > 1.1 * decays[2] else ERRS if decays[0] > max(decays[1:]) else DIFFERS,
        "Without friction nothing is held sideways, and the ring lasts longest: so far both agree. Micro-slip takes "
        "2/9 T³/(KμN) of a cycle at a tangential force T below μN: a loss factor of 2/(9π) T/(μN) [Mindlin & "
        "Deresiewicz 1953, whom the draft lists; Johnson 1985, sec. 7.4]. From 0.3 to 0.9 of μ it falls to a third. "
        "Ours has the sideways spring with its material's loss, and no micro-slip",
    )


def _t60_s(scene: Observed) -> float:
    """Find the decay of the strongest line after the tap, by Schroeder's integral from -5 to -25 dB."""
    start = int((scene.strongest.start_s + 0.01) * SR)
    energy = np.cumsum(scene.pressure_pa[start : start + SR][::-1] ** 2)[::-1]
    level = 10 * np.log10(np.maximum(energy / energy[0], 1e-30))
    at = [int(np.searchsorted(-level, x)) for x in (5, 25)]
    return 3 * (at[1] - at[0]) / SR


def squeak(scenes: Scenes) -> Verdict:
    """Find levels of what creeps."""
    levels = [scenes[key].level_db() for key in "abc"]
    sticks = [scenes[key].stick_fraction() for key in "abc"]
    return Verdict(
        "friction sticks and slips through the patch's shear compliance: a squeak",
        ", ".join(f"{x:.0f}" for x in levels)
        + " dB at 1, 3, 10 mm/s; it sticks in "
        + ", ".join(f"{100 * x:.0f}" for x in sticks)
        + " % of the steps",
        LACKING if max(sticks) == 0 else AGREES if min(sticks) > 0.05 else PARTLY,
        "The text leaves friction-induced vibration out of its scope. We have no model of it",
    )


def surface_radiates(scenes: Scenes) -> Verdict:
    """Hear both bodies alone."""
    scene = scenes["a"]
    peaks = [float(np.sqrt((scene.alone_pa(name) ** 2).mean())) for name in ("Scraper", "Ground Machined")]
    return Verdict(
        "both solids of a contact radiate",
        f"scraper alone {peaks[0]:.3g} Pa rms, ground alone {peaks[1]:.3g} Pa rms",
        AGREES if min(peaks) > 0 else DIFFERS,
    )


SWEPT = {
    "surface/ContactPitch": contact_pitch,
    "surface/FinishLadder": finish_ladder,
    "surface/ShockRate": shock_rate,
    "surface/SlidingPair": sliding_pair,
    "surface/FrictionLadder": friction_ladder,
    "surface/FaceVsPoint": face_vs_point,
    "surface/RollingVsSliding": rolling_vs_sliding,
    "surface/BounceOnset": bounce_onset,
    "surface/Landing": landing,
    "surface/MeasuredProfile": measured_profile,
    "surface/PressedRing": pressed_ring,
    "surface/Squeak": squeak,
    "surface/SurfaceRadiates": surface_radiates,
}
