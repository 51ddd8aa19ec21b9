"""Picture of a fit: spectrograms of recording and synthesis, features and the fitted circle in the (f, d) plane.

[Ren, Yeh, Lin 2013, Fig. 10, 11]

(ω² + (d − 1/β)²) = 1/β² − α/β, the circle of eq. 8, drawn as d(f)
"""

from __future__ import annotations

import os
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.files import replace_file
from sonic_bullet.lab.fit.case_fit import CaseFit, ObjectFit
from sonic_bullet.lab.fit.held_out_takes import predicted_take
from sonic_bullet.lab.fit.prediction_of_lines import predict_sound
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError
from sonic_bullet.signal.short_time import short_time_spectra

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def write_fit_picture(path: str | os.PathLike[str], found: CaseFit) -> None:
    """Draw a fit to .png, .pdf or .svg. Raises FileError."""
    dynamics_db = 80.0
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    kind = os.fspath(path).rsplit(".", 1)[-1]
    if kind not in ("png", "pdf", "svg"):
        raise FileError(f"cannot write {path}: pictures are .png, .pdf or .svg", "end the name with one of them")
    figure = Figure(figsize=(11, 8), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.2))
    o = found.objects[0] if found.objects else None
    if o is not None and o.evidence.signals is not None:
        sound, sr = o.evidence.signals[0], o.evidence.sr
        made, words = _synthesize_strike(found, o)
        top = _levels(sound).max()
        both = [figure.add_subplot(grid[0, i]) for i in (0, 1)]
        for axes, title, samples in zip(both, ("recording, first strike", words), (sound, made), strict=True):
            extent = (0, len(sound) / sr, 0, sr / 2000)
            image = axes.imshow(
                _levels(samples) - top,
                origin="lower",
                aspect="auto",
                extent=extent,
                vmin=-dynamics_db,
                vmax=0,
                cmap="magma",
            )
            axes.set(title=title, xlabel="time in s", ylabel="frequency in kHz")
        figure.colorbar(image, ax=both, label="dB below the recording's strongest", pad=0.01)
    axes = figure.add_subplot(grid[1, :])
    _plane(axes, found)
    with replace_file(path) as file:
        figure.savefig(file, format=kind, dpi=110)


def _synthesize_strike(found: CaseFit, o: ObjectFit) -> tuple[Array, str]:
    """Synthesise an object's first strike (n,) by the fit, and describe how.

    By its modes, or where its place is not known by the lines as struck on average, at the recording's energy.
    """
    e = o.evidence
    assert e.signals is not None
    sound = e.signals[0]
    if found.plays_modes(e) and np.isfinite(o.pattern[0]).all():
        made = predict_sound(o, o.pattern[0], found.fit.sigma, len(sound), e.sr)
        return made, "synthesis of that strike, modes alone"
    made, _ = predicted_take(found, e, e.recordings[0], len(sound), e.sr)
    gain = np.linalg.norm(sound) / max(float(np.linalg.norm(made)), 1e-300)
    return gain * made, "lines as struck on average, at that energy"


def _plane(axes: Axes, found: CaseFit) -> None:
    """Draw lines and the fitted circle over frequency; decays in a logarithm, ticks as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    fit = found.fit
    others = []
    for k, each in enumerate(found.objects):
        lines = each.evidence.lines
        foreign = ~np.isin(np.arange(len(lines.freq_hz)), each.line[each.line >= 0])
        label = each.evidence.thing.name if len(found.objects) > 1 else "lines that are modes, ± standard error"
        known = ~foreign
        axes.errorbar(
            lines.freq_hz[known] / 1000,
            lines.decay_per_s[known],
            lines.decay_sd_per_s[known],
            fmt="o",
            ms=4,
            capsize=2,
            color=f"C{k}",
            label=label,
        )
        others.append(np.stack([lines.freq_hz[foreign] / 1000, lines.decay_per_s[foreign]]))
        axes.plot(
            each.freq_hz[each.line < 0] / 1000, each.decay_per_s[each.line < 0], "o", ms=5, mfc="none", color=f"C{k}"
        )
    if others and np.concatenate(others, axis=1).size:
        axes.plot(*np.concatenate(others, axis=1), "x", color="0.5", label="lines that are no mode")
    if any((each.line < 0).any() for each in found.objects):
        axes.plot([], [], "o", ms=5, mfc="none", color="0.3", label="modes not observed")
    if not found.objects:
        axes.plot(fit.freq_hz / 1000, fit.decay_per_s, "o", ms=4, label="lines")
    freq = np.linspace(0, 1.05 * fit.freq_hz.max(initial=1000.0), 600)
    if np.isfinite(np.diag(fit.covariance)[:2]).any():
        axes.plot(
            freq / 1000,
            circle(freq, fit.alpha_per_s, fit.beta_s),
            "k-",
            lw=1,
            label=f"circle: α = {fit.alpha_per_s:.4g} 1/s, β = {fit.beta_s:.4g} s",
        )
    axes.set(xlabel="frequency in kHz", ylabel="decay in 1/s", yscale="log", xlim=(0, freq[-1] / 1000))
    axes.set_title(fill(f"{found.case.name}: {fit.verdict}", 130, max_lines=3, placeholder=" …"), fontsize=10)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(color="0.92")
    axes.legend(fontsize=8)


def circle(freq_hz: Array, alpha_per_s: float, beta_s: float) -> Array:
    """Compute the decay (k,) of modes that ring at freq_hz (k,) [eq. 8], the lower branch; NaN past the circle."""
    square = (2 * np.pi * freq_hz) ** 2
    if beta_s == 0:
        return np.full(len(freq_hz), alpha_per_s / 2)
    inside = 1 - beta_s * (alpha_per_s + beta_s * square)
    # 1/β − √(1/β² − α/β − ω²), without cancellation
    return np.asarray(
        np.where(inside >= 0, (alpha_per_s + beta_s * square) / (1 + np.sqrt(np.maximum(inside, 0))), np.nan)
    )


def _levels(sound: Array) -> Array:
    spectrum_window = 1024
    window = min(spectrum_window, len(sound))
    spectra = short_time_spectra(sound, window, max(1, window // 4))
    return np.asarray(20 * np.log10(np.abs(spectra).T + 1e-12))
