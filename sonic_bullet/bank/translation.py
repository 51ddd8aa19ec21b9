"""Translations of a rigid body: one pole, three axes, forces and cells of pulses in, far pressure out.

    z <- z p + (1 + i d/ω) (e^s - 1)/s · F period + Σ strikes,    dipole = weight Re z
    force: acts evenly over the sample before its instant; strike: even over the cells of the sample grid,
        at each sample   j (1 + i d/ω) (D - 1)/(s/c) Σ_i ΔQ_i D^i    over the c cells before it,  D = e^{s/c}
        (its own impulses, evenly over the cells, as such a mode responds to the slope of a slow force)
    all forces on a body act as one:   F = Σ ± f (d0 + (d1 - d0) x)

Such a mode (see bank.resonator) decays within some ten or hundred samples: it runs sample by sample, and rests where
it has fallen below the floor at one of every DRIVEN samples of absolute time.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from sonic_bullet.bank import drive
from sonic_bullet.bank.kernels import uncounted
from sonic_bullet.bank.layout import DRIVEN, FLOOR, FLUSH
from sonic_bullet.contact.pulse_shape import cumulated


@uncounted
def _gather_forces(n, onset_re, onset_im, axis_impulse):  # pragma: no cover - compiled
    """Turn the impulses in rows 0, 2, 4 of axis_impulse (6, n or more) into real and imaginary part of each axis."""
    for axis in range(3):
        real, imag = axis_impulse[2 * axis], axis_impulse[2 * axis + 1]
        for k in range(n):
            impulse = real[k]
            impulse = impulse if abs(impulse) >= FLUSH else 0.0
            real[k] = impulse * onset_re
            imag[k] = impulse * onset_im


@uncounted
def _strike_cells(at, n, slot, bank, axis_impulse):  # pragma: no cover - compiled
    """Add the cells of a strike that end by the samples at … at + n - 1. It is done after its last."""
    strike, hertz = bank.strikes[slot], bank.hertz
    cells = strike.cells
    first, last = strike.cell_first // cells + 1, (strike.cell_stop - 1) // cells + 1
    turn = complex(strike.cell_turn[0], strike.cell_turn[1])
    onset = complex(strike.cell_onset[0], strike.cell_onset[1])
    for sample in range(max(first, at), min(last + 1, at + n)):
        total = complex(0.0, 0.0)
        cell = (sample - 1) * cells
        before = cumulated((cell / cells - strike.start) / strike.length, hertz, strike.flat)
        for i in range(cells):
            after = cumulated(((cell + i + 1) / cells - strike.start) / strike.length, hertz, strike.flat)
            total = total * turn + (after - before)
            before = after
        total *= onset
        for axis in range(3):
            axis_impulse[2 * axis, sample - at] += strike.rigid_impulse_n_s[axis] * total.real
            axis_impulse[2 * axis + 1, sample - at] += strike.rigid_impulse_n_s[axis] * total.imag
    if last < at + n:
        strike.rigid = 0


@uncounted
def _run_axes(at, n, b, bank, axis_impulse, dipole):  # pragma: no cover - compiled
    """Run the recursion on all axes through the samples at … at + n - 1."""
    body, motion = bank.body[b], bank.ringing[b].motion
    p_re, p_im, weight = body.rigid_pole[0], body.rigid_pole[1], body.rigid_weight
    x, xi, y, yi, z, zi = motion[0, 0], motion[0, 1], motion[1, 0], motion[1, 1], motion[2, 0], motion[2, 1]
    floor = FLOOR**2
    k = 0
    while k < n:
        if (at + k) % DRIVEN == 0:
            if x * x + xi * xi < floor:
                x, xi = 0.0, 0.0
            if y * y + yi * yi < floor:
                y, yi = 0.0, 0.0
            if z * z + zi * zi < floor:
                z, zi = 0.0, 0.0
        end = min(n, k + DRIVEN - (at + k) % DRIVEN)
        for i in range(k, end):
            x, xi = x * p_re + (axis_impulse[0, i] - xi * p_im), xi * p_re + (axis_impulse[1, i] + x * p_im)
            y, yi = y * p_re + (axis_impulse[2, i] - yi * p_im), yi * p_re + (axis_impulse[3, i] + y * p_im)
            z, zi = z * p_re + (axis_impulse[4, i] - zi * p_im), zi * p_re + (axis_impulse[5, i] + z * p_im)
            dipole[0, i] = x * weight
            dipole[1, i] = y * weight
            dipole[2, i] = z * weight
        k = end
    for axis in range(3):
        row = dipole[axis]
        for i in range(n):
            if abs(row[i]) < FLUSH:
                row[i] = 0.0
    motion[0, 0], motion[0, 1], motion[1, 0], motion[1, 1], motion[2, 0], motion[2, 1] = x, xi, y, yi, z, zi
    moves = x != 0.0 or xi != 0.0 or y != 0.0 or yi != 0.0 or z != 0.0 or zi != 0.0
    bank.ringing[b].moving = 1 if moves else 0


@uncounted
def translate(at, n, b, bank, scratch, work):  # pragma: no cover - compiled
    """Compute samples at … at + n - 1 of body b's translations into scratch.dipole[b]. False where they rest.

    work: its forces are listed (`bank_kernel.list_forces`).
    """
    strikes, axis_impulse, first, last = bank.strikes, work.axis_impulse, work.first[b], work.first[b + 1]
    struck = False
    slot = bank.ringing[b].strike
    while slot >= 0:
        struck = struck or (strikes[slot].rigid != 0 and strikes[slot].start < at + n)
        slot = strikes[slot].next
    if not (struck or last > first or bank.ringing[b].moving):
        return False
    forces = drive.Forces(work.side, first, last, work.signal, work.signal.shape[2])
    drive.sum_impulses(axis_impulse, axis_impulse.shape[1], forces, scratch.direction0, scratch.direction1, n)
    _gather_forces(n, bank.body[b].rigid_onset[0], bank.body[b].rigid_onset[1], axis_impulse)
    slot = bank.ringing[b].strike
    while struck and slot >= 0:
        if strikes[slot].rigid:
            _strike_cells(at, n, slot, bank, axis_impulse)
        slot = strikes[slot].next
    _run_axes(at, n, b, bank, axis_impulse, scratch.dipole[b])
    return True
