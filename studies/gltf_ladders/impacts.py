"""Ladders of impacts: what the draft predicts of each, and what is measured here."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studies.gltf_ladders.observed import SR, Observed
from studies.gltf_ladders.verdicts import AGREES, ERRS, PARTLY, Verdict, within

Scenes = Mapping[str, Observed]


def acceleration_noise(scenes: Scenes) -> Verdict:
    """Find how long the sound lasts, beside the pulse that makes it."""
    bead = scenes["a"]
    energy = np.cumsum(bead.pressure_pa**2)
    first, last = np.searchsorted(energy, np.array([5e-4, 1 - 5e-4]) * energy[-1])
    lasts, pulse = (last - first) / SR, bead.strongest.length_s
    after = float(np.abs(bead.pressure_pa[last + SR // 100 :]).max())
    return Verdict(
        "no mode is in the band, the recoil alone sounds",
        f"99.9 % of the energy within {1e6 * lasts:.0f} µs of a pulse of {1e6 * pulse:.0f} µs; {after:.1g} Pa from "
        f"10 ms on; peak {np.abs(bead.pressure_pa).max():.2f} Pa",
        AGREES if lasts < 4 * pulse and after < 1e-9 else PARTLY,
    )


def contact_duration(scenes: Scenes) -> Verdict:
    """Find pulses of three masses."""
    lengths = [scenes[key].strongest.length_s for key in "abc"]
    powers = [np.log(lengths[k + 1] / lengths[k]) / np.log(step) for k, step in ((0, 100), (1, 10))]
    return Verdict(
        "heavier is longer: mass^(2/5) by Hertz, mass^(1/3) by the draft's law of faces",
        f"{1e6 * lengths[0]:.1f}, {1e6 * lengths[1]:.1f}, {1e6 * lengths[2]:.1f} µs: mass^{powers[0]:.3f} from 5 to "
        f"500 g, mass^{powers[1]:.3f} to 5 kg",
        AGREES if all(1 / 3 - 0.01 <= power <= 0.41 for power in powers) else PARTLY,
        "Each contact is as soft as the softer of Hertz' cap and its face. The light ones are faces, the heavy one "
        "is on its way from the one law to the other",
    )


def patch_growth(scenes: Scenes) -> Verdict:
    """Find how pulses shorten from a light to a hard landing."""
    ball = scenes["b"].strongest.length_s / scenes["a"].strongest.length_s
    box = scenes["d"].strongest.length_s / scenes["c"].strongest.length_s
    return Verdict(
        "ten times the speed: the ball's pulse 10^(-1/5) = 0.631 as long, the box's the same; 0.594 with the layer "
        "that the machined finish is (Landing)",
        f"{ball:.3f} and {box:.3f}",
        AGREES if within(ball, 0.594, 0.02) and within(box, 1, 1e-6) else PARTLY,
    )


def separation(scenes: Scenes) -> Verdict:
    """Count strikes."""
    lively, dead = len(scenes["a"].pulses), len(scenes["b"].pulses)
    return Verdict(
        "who bounces strikes again and again, who lands dead once",
        f"{lively} strikes and {dead} in 2 s",
        AGREES if lively > 2 and dead == 1 else PARTLY,
    )


def strike_one(scenes: Scenes) -> Verdict:
    """Hear each of three bodies alone."""
    peaks = {name: float(np.abs(scenes["a"].alone_pa(name)).max()) for name in ("At rest", "Struck", "At rest too")}
    return Verdict(
        "of three instances of one model only the struck one rings",
        "peaks alone: " + ", ".join(f"{name} {peak:.3g} Pa" for name, peak in peaks.items()),
        AGREES if peaks["At rest"] == peaks["At rest too"] == 0 < peaks["Struck"] else PARTLY,
    )


def restitution(scenes: Scenes) -> Verdict:
    """Find levels of a slide at three restitutions."""
    levels = [scenes[key].level_db() for key in "abc"]
    same = all(np.array_equal(scenes["a"].pressure_pa, scenes[key].pressure_pa) for key in "bc")
    return Verdict(
        "restitution sets the contact's dissipation, nothing else differs",
        f"{levels[0]:.1f}, {levels[1]:.1f}, {levels[2]:.1f} dB at 0, 0.5, 0.9" + ("; the same samples" if same else ""),
        ERRS if same else AGREES,
        "e = 1 - αv, and the force's dissipation is 3/2 α [Hunt & Crossley 1975, whom the draft cites for it; Johnson "
        "1985, sec. 11.5]. At the mm/s at which a rough contact meets, e is 0.99 and more whatever it is at 1 m/s. "
        "What is lost there goes as waves into both bodies, and that is the same for all three",
    )


def relief_and_scale(scenes: Scenes) -> Verdict:
    """Find lines and finishes of three sizes."""
    bodies = [scenes[key].body(name) for key, name in (("a", "Half size"), ("b", "Reference"), ("c", "Double size"))]
    same = all(np.array_equal(body.material.octave_rms_m, bodies[0].material.octave_rms_m) for body in bodies)
    clear = [
        [_line_hz(scenes[key], f)[1] for f in one.model.freq_hz[:6]] for key, one in zip("abc", bodies, strict=True)
    ]
    clearest = int(np.argmax(np.min(clear, axis=0)))
    modes = [float(body.model.freq_hz[clearest]) for body in bodies]
    heard = [_line_hz(scenes[key], f)[0] for key, f in zip("abc", modes, strict=True)]
    return Verdict(
        "size detunes the model by 2, 1, 1/2; the finish stays",
        f"the mode of the clearest line {modes[0]:.0f}, {modes[1]:.0f}, {modes[2]:.0f} Hz; lines of the sound at "
        f"{heard[0]:.0f}, {heard[1]:.0f}, {heard[2]:.0f} Hz: {heard[0] / heard[1]:.3f}, 1, {heard[2] / heard[1]:.3f}; "
        f"finishes {'equal' if same else 'differ'}",
        AGREES if same and within(heard[0] / heard[1], 2, 0.01) and within(heard[2] / heard[1], 0.5, 0.01) else PARTLY,
        "The text takes a node's first scale for the model's own size; the scenes take 1 for it, and so do we. "
        "The map's waves are 300 mm long and pass at 0.3 Hz: nobody hears them",
    )


def _line_hz(scene: Observed, near_hz: float) -> tuple[float, float]:
    """Find the strongest line within a hundredth of a frequency, and its power over the median within a tenth."""
    sound = scene.pressure_pa[int(0.3 * SR) :]
    power = np.abs(np.fft.rfft(sound * np.hanning(len(sound)))) ** 2
    freq = np.fft.rfftfreq(len(sound), 1 / SR)
    near, around = np.abs(freq / near_hz - 1) < 0.01, np.abs(freq / near_hz - 1) < 0.1
    found = int(np.argmax(power[near]))
    return float(freq[near][found]), float(power[near][found] / np.median(power[around]))


IMPACTS = {
    "AccelerationNoise": acceleration_noise,
    "ContactDuration": contact_duration,
    "PatchGrowth": patch_growth,
    "Separation": separation,
    "StrikeOne": strike_one,
    "surface/RestitutionLadder": restitution,
    "surface/ReliefAndScale": relief_and_scale,
}
