"""How does each effect look? One small picture each, of one body without it and with it.

    python studies/effect_pictures.py [-o docs/explanation/pictures] [ID ...]

A free square plate of glass, 150 × 150 × 4 mm, solved as any body is, struck near a corner, observed at an edge:

    Material -> modes -> effects on MODES -> Ring -> BANK -> pulses (FORCE) -> Sound -> SOUND -> picture

Only `apply` of the package's own effects is used; numbers are typical ones, chosen so that the effect is plain to see.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from sonic_bullet import modal
from sonic_bullet.effects import Effect, Impact, Ring, Sound, Stage
from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.common.ringing import synthesize_ring
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.effects.orthotropy import Orthotropy
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.records import Array, Material, ModalModel, Shape

SR = 48_000
SIZE_M = (0.15, 0.15, 0.004)
TO_HZ = 12_000.0
GLASS = Material.isotropic("glass", youngs_pa=7e10, poisson=0.22, density_kg_m3=2500, alpha_per_s=12.0, beta_s=2e-8)
CORNER, EDGE = (0.068, 0.059, 0.002), (0.0, 0.075, 0.002)
IMPULSE_N_S = 0.02
BEFORE, AFTER = "0.55", "#b02a1a"
DULL = DampingLaw("constant-loss", 0.05)  # a body that is soon silent, where what comes later is to be seen


@dataclass(frozen=True)
class Chain:
    """The plate under some effects: its modes, and its sound at a strike of an impulse in N·s."""

    effects: tuple[Effect, ...] = ()

    def at(self, stage: Stage) -> tuple[Effect, ...]:
        return tuple(e for e in self.effects if e.stage is stage)

    def model(self) -> ModalModel:
        material = GLASS
        for effect in self.at(Stage.MATERIAL):
            material = effect.apply(material)
        model = modal.analyse((Shape("box", np.array(SIZE_M)),), material, to_hz=TO_HZ)
        for effect in self.at(Stage.MODES):
            model = effect.apply(model)
        return model

    def ring(self, impulse_n_s: float) -> Ring:
        """The modes as the strike starts them: vertical velocity at the edge, level at the place that moves most."""
        model = self.model()
        shape = model.shape.astype(float)
        strike, sensor = (int(np.argmin(np.linalg.norm(model.vertex_m - point, axis=1))) for point in (CORNER, EDGE))
        push = -impulse_n_s * shape[strike, 2]
        none = np.zeros(model.mode_count)
        level = np.abs(push) * np.linalg.norm(shape, axis=1).max(axis=0)
        ring = Ring(
            model.freq_hz, model.decay_per_s, (push * shape[sensor, 2]).astype(complex), level, none, none, impulse_n_s
        )
        for effect in self.at(Stage.BANK):
            ring = effect.apply(ring)
        return ring

    def sound(self, impulse_n_s: float = IMPULSE_N_S, seconds: float = 1.0, only: int | None = None) -> Array:
        """Velocity (n,) in m/s; only: of one mode."""
        impact = Impact(impulse_n_s, np.zeros(1), np.ones(1))
        for effect in self.at(Stage.FORCE):
            impact = effect.apply(impact)
        ring = self.ring(impulse_n_s)
        if only is not None:
            ring = replace(ring, amplitude=np.where(np.arange(len(ring.amplitude)) == only, ring.amplitude, 0))
        sound = Sound(synthesize_ring(ring, impact, int(seconds * SR), SR), SR, impulse_n_s)
        for effect in self.at(Stage.SOUND):
            sound = effect.apply(sound)
        return np.asarray(sound.sample)


def loudest(chain: Chain) -> int:
    """The mode that is loudest at the sensor, by its sum over time."""
    ring = chain.ring(IMPULSE_N_S)
    return int(np.argmax(np.abs(ring.amplitude) / np.sqrt(ring.decay_per_s)))


def decays(axes: Any, effect: Effect) -> None:
    """Decay over frequency, mode by mode."""
    for chain, colour, name in ((Chain(), BEFORE, "Rayleigh's law"), (Chain((effect,)), AFTER, "with the effect")):
        model = chain.model()
        axes.loglog(model.freq_hz, model.decay_per_s, "o", ms=3, color=colour, label=name)
    axes.set(xlabel="frequency in Hz", ylabel="decay in 1/s")


def shifts(axes: Any, effect: Effect) -> None:
    """Relative shift of each mode's frequency."""
    before, after = Chain().model().freq_hz, Chain((effect,)).model().freq_hz
    count = min(len(before), len(after), 24)
    axes.bar(np.arange(1, count + 1), 100 * (after[:count] / before[:count] - 1), color=AFTER)
    axes.axhline(0, color=BEFORE, lw=0.8)
    axes.set(xlabel="mode, by frequency", ylabel="shift in %")


def spectra(axes: Any, effect: Effect, band_hz: tuple[float, float] = (200.0, TO_HZ), seconds: float = 1.0) -> None:
    """Magnitude over frequency."""
    for chain, colour, name in ((Chain((effect,)), AFTER, "with the effect"), (Chain(), BEFORE, "without")):
        sound = chain.sound(seconds=seconds)
        freq = np.fft.rfftfreq(len(sound), 1 / SR)
        level = 20 * np.log10(np.abs(np.fft.rfft(sound * np.hanning(2 * len(sound))[len(sound) :])) / SR + 1e-12)
        inside = (freq >= band_hz[0]) & (freq <= band_hz[1])
        axes.plot(freq[inside], level[inside], color=colour, lw=0.7, label=name)
    low, high = axes.get_ylim()
    axes.set(xlabel="frequency in Hz", ylabel="level in dB", ylim=(max(low, high - 90), high))


def waves(axes: Any, effect: Effect) -> None:
    """The first 60 ms of a dull plate."""
    for chain, colour, name in ((Chain((DULL, effect)), AFTER, "with the effect"), (Chain((DULL,)), BEFORE, "without")):
        sound = chain.sound(seconds=0.06)
        axes.plot(1000 * np.arange(len(sound)) / SR, sound, color=colour, lw=0.5, label=name)
    axes.set(xlabel="time in ms", ylabel="velocity in m/s")


def energies(axes: Any, effect: Effect) -> None:
    """What is left of the energy after each instant, of a dull plate [Schroeder 1965]."""
    for chain, colour, name in ((Chain((DULL,)), BEFORE, "without"), (Chain((DULL, effect)), AFTER, "with the effect")):
        left = np.cumsum(chain.sound(seconds=1.5)[::-1] ** 2)[::-1]
        axes.plot(np.arange(len(left)) / SR, 10 * np.log10(left / left[0] + 1e-12), color=colour, lw=1.2, label=name)
    axes.set(xlabel="time in s", ylabel="energy left in dB", ylim=(-60, 2), xlim=(0, 1.2))


def by_strength(axes: Any, effect: Effect, track: Callable[[Array], tuple[Array, Array]], label: str) -> None:
    """A track of the loudest mode at three strengths."""
    chain = Chain((effect,))
    mode = loudest(chain)
    for share, colour in ((0.25, "#e0b0a8"), (0.5, "#cc6a5c"), (1.0, AFTER)):
        time, value = track(chain.sound(share * IMPULSE_N_S, 0.5, mode))
        axes.plot(time, value, color=colour, lw=1.2, label=f"{1000 * share * IMPULSE_N_S:g} mN·s")
    axes.set(xlabel="time in s", ylabel=label)


def frequency(sound: Array) -> tuple[Array, Array]:
    """Instantaneous frequency in Hz by the analytic signal, over 5 ms means."""
    from scipy.signal import hilbert

    phase = np.unwrap(np.angle(hilbert(sound)))
    step = SR // 200
    inside = np.arange(2 * step, int(0.35 * SR), step)
    return inside / SR, (phase[inside + step] - phase[inside]) * SR / (2 * np.pi * step)


def envelope(sound: Array) -> tuple[Array, Array]:
    """Level in dB against its own start."""
    from scipy.signal import hilbert

    size = np.abs(hilbert(sound))[48 : int(0.4 * SR) : 240]
    return (48 + 240 * np.arange(len(size))) / SR, 20 * np.log10(size / size[0])


def pair() -> tuple[float, float]:
    """The plate's lowest degenerate pair: its frequency, and half the width of what is drawn about it."""
    freq = Chain().model().freq_hz
    low = int(np.flatnonzero(np.diff(freq) < 1e-3 * freq[:-1])[0])
    return float(freq[low]), 0.02 * float(freq[low])


def orthotropic() -> Orthotropy:
    """The glass with its stiffness along y at a third of that along x."""
    c11, c12, c44 = 7.99e10, 2.25e10, 2.87e10
    return Orthotropy((c11, c11 / 3, c11, c12 / 2, c12, c12 / 2, c44, c44, c44), "orthorhombic")


def drawn() -> dict[str, tuple[Effect, Callable[[Any, Any], None]]]:
    """What is drawn of each effect, by its id."""
    middle, reach = pair()
    members: tuple[tuple[Any, Callable[[Any, Any], None]], ...] = (
        (DampingLaw("constant-loss", 4e-3), decays),
        (orthotropic(), shifts),
        (
            ModeSplitting((middle,), (0.008,), (0.4,)),
            lambda axes, e: spectra(axes, e, (middle - reach, middle + reach), 3.0),
        ),
        (AddedMass(CORNER, 0.01), shifts),
        (SupportDamping((CORNER,), (2.0,)), decays),
        (Radiation(0.04, 1.0), decays),
        (ContactTime(4e-4, IMPULSE_N_S), spectra),
        (Rebound(0.02, IMPULSE_N_S, 0.6), waves),
        (AmplitudePitch(0.02), lambda axes, e: by_strength(axes, e, frequency, "frequency in Hz")),
        (AmplitudeDamping(4.0), lambda axes, e: by_strength(axes, e, envelope, "level in dB")),
        (ForeignMode((1900.0, 5300.0), (9.0, 20.0), (40.0, 25.0), (0.3, -1.0)), spectra),
        (Room(0.8, 0.7, 11), energies),
        (MeasurementChain(high_pass_hz=2500.0, high_order=2), spectra),
    )
    return {effect.id: (effect, draw) for effect, draw in members}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/explanation/pictures"))
    parser.add_argument("ids", nargs="*", metavar="ID", help="these alone")
    asked = parser.parse_args(arguments)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    members = drawn()
    unknown = set(asked.ids) - set(members)
    if unknown:
        print(f"no effect {', '.join(sorted(unknown))}; there are {', '.join(members)}", file=sys.stderr)
        return 2
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in asked.ids or members:
        effect, draw = members[name]
        figure = Figure(figsize=(4.6, 2.5), dpi=100, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        draw(axes, effect)
        axes.tick_params(labelsize=7, which="both")
        axes.spines[["top", "right"]].set_visible(False)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=7, frameon=False)
        path = asked.out / f"{name}.png"
        figure.savefig(path, metadata={"Software": None})
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
