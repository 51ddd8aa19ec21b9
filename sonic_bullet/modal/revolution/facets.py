"""What the facets of a meridian leave open: its polygon is solved, and arcs between its corners were perhaps meant.

a side of length L that turns by α and β from chord to arc at its ends: mean gap of the arc L (α + β)/12
    [cubic Hermite; of a circle κL²/12]
corner turned by θ between sides L, L': θ L/(L + L') and θ L'/(L + L') are theirs; all of it the shorter one's where
    L and L' are unlike, as an arc's last chord meets a straight wall; none of a crease
surface moved out by g:  δλ = ∫ g (ε:C:ε − λ |u|²) dA for uᵀMu = 1      [Hadamard 1908; Rayleigh's quotient, varied]
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import partial

import numpy as np

from sonic_bullet.geometry import CREASE_RAD
from sonic_bullet.modal.revolution.meridian import project_on_walk
from sonic_bullet.modal.revolution.rings import BodyOfRevolution, turns
from sonic_bullet.modal.revolution.section import Section
from sonic_bullet.modal.revolution.series import assemble_series
from sonic_bullet.modal.sectors import Sector
from sonic_bullet.records import Array


def arc_gaps(body: BodyOfRevolution) -> Array:
    """Compute how far outside each side (p,) of the outline the arc through its corners lies, on the mean."""
    most_apart = 0.3  # relative difference of sides that are chords of one arc
    along = np.roll(body.outline_m, -1, axis=0) - body.outline_m
    length, turn, on = np.linalg.norm(along, axis=1), turns(body.outline_m), body.on_axis
    heading = np.arctan2(along[:, 1], along[:, 0])
    before = np.roll(length, 1)
    first, last = np.roll(on, 1), on  # corners where the outline leaves the axis and where it comes back
    mirrored = np.where(first, 2 * heading, -2 * np.roll(heading, 1))  # it meets its mirror image there
    turn = np.where(first | last, (mirrored + np.pi) % (2 * np.pi) - np.pi, turn)
    after, before = np.where(last, before, length), np.where(first, length, before)
    turn = np.where(np.abs(turn) < CREASE_RAD, turn, 0.0)
    alike = np.abs(after - before) <= most_apart * np.maximum(after, before)
    share = np.where(alike, after / (after + before), after < before)  # of the side that begins there
    gap = length * (turn * share + np.roll(turn * (1 - share), -1)) / 12
    return np.where(on, 0.0, gap)


def facets_error(body: BodyOfRevolution, section: Section, sectors: Sequence[Sector], tensor: Array) -> float:
    """Compute by how much at most, relative, the modes found change where arcs take the facets' places."""
    from skfem import ElementTriP3, FacetBasis

    gap = arc_gaps(body)
    if not gap.any():
        return 0.0
    factor = _gap_of_sides(body, section, gap)[~section.on_axis]
    near_enough = 1e-8  # of a triangle's side: points on the smallest ones cannot be placed to 1e-12 of theirs
    mapping = copy(section.basis.mapping)
    mapping.invF = partial(mapping.invF, newton_tol=near_enough)
    rim = FacetBasis(section.basis.mesh, ElementTriP3(), mapping, facets=section.facet[~section.on_axis], intorder=6)
    most = 0.0
    for sector in sectors:
        m, problems = sector.unknowns
        value, vector = sector.found[0]
        ((k0, k1, k2),), mass = assemble_series(rim, factor, [tensor], problems.place)
        u = problems.free(m) @ vector
        change = np.einsum("nb,nb->b", u, (k0 + m * k1 + m * m * k2) @ u - (mass @ u) * value)
        most = max(most, float(np.abs(change / value).max(initial=0.0)) / 2)
    return most


def _gap_of_sides(body: BodyOfRevolution, section: Section, gap: Array) -> Array:
    """Compute the mean gap (s,) along each side of the section, which may span several of the outline's."""
    length = np.linalg.norm(np.roll(body.outline_m, -1, axis=0) - body.outline_m, axis=1)
    walked, summed_gap = (np.append(0.0, np.cumsum(x)) for x in (length, length * gap))
    start = project_on_walk(body.outline_m, section.rim_m[:, 0]).place
    end = np.roll(start, -1)
    end = np.where(end <= start, end + walked[-1], end)
    again = end > walked[-1]
    total = np.interp(np.where(again, end - walked[-1], end), walked, summed_gap) + again * summed_gap[-1]
    return np.asarray((total - np.interp(start, walked, summed_gap)) / (end - start))
