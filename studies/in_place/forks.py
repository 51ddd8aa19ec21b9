"""A tuning fork whose foot stands on a board: what the board makes of it, and what that costs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sonic_bullet.engine.contact.coupling import ContactSpring
from studies.in_place.lines import Line
from studies.in_place.standing import AT_M, POINT_LOSS, POINT_N_M
from studies.in_place.things import MINDLIN, Stands, Thing, board, fork, spring, stand, with_plate

YOKES_M = (0.014, 0.008, 0.005)
FOOT_M = np.array([[0.0, 0.004, 0.0]])


def foot_over_tip(one: Thing) -> float:
    """Motion of its foot over that of its tips, in its first mode."""
    tip = one.resonator.shape[one.model.vertex_m[:, 2].argmax(), :, 0].astype(float)
    return float(abs(one.place(FOOT_M[0]).shape[2, 0]) / np.linalg.norm(tip))


def taken_per_s(stands: Stands, k: ContactSpring) -> float:
    """Part of the first mode's decay that board and contact take, by the eigenvector of all: −Re s qᴴq = qᴴDq +
    Im(uᴴKu)/2ω, u the stretch of the spring.
    """
    one, on = stands.thing.mobility, stands.board.mobility
    s, at = stands.s, np.abs(stands.s.imag - stands.newton.omega_rad_s[0]).argmin()
    q, m = stands.q[:, at], len(one.lam)
    top = float(stands.board.model.vertex_m[:, 2].max())
    below = stands.board.place(np.array([AT_M[0], AT_M[1] + FOOT_M[0, 1], top]))
    stretch = one.moves([stands.thing.place(FOOT_M[0])]) @ q[:m] - on.moves([below]) @ q[m:]
    lost = np.array([k.normal_n_m.imag, *2 * [k.tangential_n_m.imag]]) @ np.abs(stretch) ** 2 / (2 * s[at].imag)
    return float((on.decay @ np.abs(q[m:]) ** 2 + lost) / np.linalg.norm(q) ** 2)


def fork_on_board() -> Iterator[Line]:
    on, k = board(), spring(POINT_N_M, POINT_LOSS)
    for yoke in YOKES_M:
        one = fork(yoke)
        placed = stand(one, on, FOOT_M, [k], AT_M)
        louder, grown = [], []
        taken = taken_per_s(placed, k)
        for how in (placed.newton, placed.runs):
            own = one.resonator.weight[0, 0]
            # pressure is iωρ₀ times velocity: a partner's mode sounds with the frequency at which it is moved
            of_board = (on.resonator.weight[:1] / on.resonator.omega_rad_s @ how.transmissions[0])[0]
            whole = own + of_board[0] * how.omega_rad_s[0]
            louder.append(20 * np.log10(abs(whole) / abs(own)))
            grown.append((how.decay_per_s[0] - one.mobility.decay_per_s[0]) / taken)
        name = f"fork {one.hz[0]:.0f} Hz, its foot's motion {foot_over_tip(one):.2%} of its tip's, on 24 mm of wood"
        yield Line(
            f"{name}: louder at equal speed of its tines",
            ">= 10 dB",
            f"Newton {louder[0]:.1f}, run {louder[1]:.1f} dB",
            bool(min(louder) >= 10),
        )
        yield Line(
            "… growth of its decay over what board and contact take",
            "1 ± 0.01",
            f"Newton {grown[0]:.4f}, run {grown[1]:.4f} of {taken:.2g}/s (free {one.moving.decay_per_s[0]:.2g}/s)",
            bool(np.abs(np.array(grown) - 1).max() <= 0.01),
        )


def matched_board() -> Iterator[Line]:
    """A wide plate of the impedance mω, m the fork's mass, known by nothing else."""
    k = ContactSpring(complex(POINT_N_M), MINDLIN * complex(POINT_N_M))
    for yoke in YOKES_M:
        one = fork(yoke)
        impedance = one.mobility.mass_kg * one.mobility.omega_rad_s[0]
        shape = one.place(FOOT_M[0]).shape[2, 0]
        most = shape**2 * impedance / 4  # ½|v|² mω/2 of ½|z|², v what the foot would do if free
        figures, holds = [f"{one.moving.decay_per_s[0] / (one.moving.decay_per_s[0] + most):.0%} by hand"], True
        for share in (0.1, 1.0, 10.0):
            placed = stand(one, with_plate(board(), 1 / (share * impedance)), FOOT_M, [k], AT_M, eigen=False)
            kept = [placed.kept(how)[0] for how in (placed.newton, placed.runs)]
            figures.append(f"{share:g} mω: Newton {kept[0]:.0%}, run {kept[1]:.0%}")
            holds &= share != 1.0 or max(kept) <= 0.5
        yield Line(
            f"fork {one.hz[0]:.0f} Hz, foot {foot_over_tip(one):.2%}, on a wide plate of impedance mω = "
            f"{impedance:.0f} N·s/m: T60 over free",
            "<= 50 %",
            "; ".join(figures),
            holds,
        )
