"""Size and degree of the elements that a body is solved with first, from what is wanted and what may be spent.

mesh, wall, shortest wave, count of modes -> edge -> filled -> larger, less detail or degree 2 where it is too much
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.files.storage import cache as store
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal import cost, lagrange, polynomials
from sonic_bullet.modal.cost import CUBIC_UNKNOWNS, MOST_UNKNOWNS, UNKNOWNS_A_TET
from sonic_bullet.modal.elements import Elements, coarse
from sonic_bullet.modal.kept_solids import kept_or_filled
from sonic_bullet.modal.keys import key
from sonic_bullet.modal.meshing.filling import LATTICE_NOTE, THICKENED_TETS, Filler, coarse_edge_m, has_detail
from sonic_bullet.modal.meshing.shape_meshes import skin_of, united_skin
from sonic_bullet.modal.meshing.sizes import edge_within_m
from sonic_bullet.modal.meshing.tetrahedra import EndlessError
from sonic_bullet.modal.sectors import MOST_MODES, WantedModes
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.shape_meshes import FilledBody


def fill_with_elements(
    shapes: tuple[Shape, ...],
    length_m: float,
    tensor: Array,
    wanted: WantedModes,
    clamp: Array,
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    *,
    draft: bool = False,
) -> Elements:
    """Fill any body with elements of a first size, for a material of stiffness (6, 6).

    Parameters
    ----------
    clamp : (k, 4) spheres that hold it
    sizes : edge_m, None for the size that ``wanted`` needs, and thickness_m
    kept : cache and name of the body filled with elements
    draft : few elements, and no estimate of their error

    Raises
    ------
    MeshError, ModalError
        The body cannot be filled, or its clamps do not fit it.
    """
    wide = 2.2  # given elements over 2V/A, which is half as thick as a bar: wider ones take degree 3
    given, thickness_m = sizes

    def at_size(edge_m: float, filler: Filler) -> FilledBody:
        cache, name = kept
        name = key("solid", name, edge_m, filler if filler in ("simple", "draft") else filler == "lattice")
        return kept_or_filled(shapes, (edge_m, thickness_m), (cache, name), filler=filler)

    def coarse_body(tets: float) -> Elements:
        skin = skin_of(shapes, thickness_m)
        edge = coarse_edge_m(skin, tets)
        thin = edge > skin.thickness_m
        return Elements(at_size(edge, "draft"), length_m, clamp, 2, thin, edge, None, wanted.most, draft=draft)

    if draft:
        return coarse_body(cost.DRAFT_TETS)
    # the nodes that a clamp reaches depend on the size, which moves modes by up to 1 %: one size, whatever is wanted
    first = WantedModes(np.inf, MOST_MODES) if len(clamp) else wanted
    wall_m, edge_m, modes, simple = _first(shapes, thickness_m, length_m, tensor, first)
    edge = given or edge_m
    thin = edge > wall_m
    degree = 2 if given and given < wide * wall_m else 3
    anew = None if given else at_size
    try:
        body = at_size(edge, "any")
        united = united_skin(shapes, thickness_m)
        skin = None if united is None else (united.vertex_m, united.face)
        if given is None and body.solid.note.startswith(LATTICE_NOTE):
            # it is rounded more than its field errs: degree 2 on three times the elements is as dear and rounds it less
            degree = 2
            if body.solid.thickened != 1:
                edge = coarse_edge_m(skin_of(shapes, thickness_m) if united is None else united, THICKENED_TETS)
            elif len(body.solid.tet) < THICKENED_TETS:
                finer = edge * (len(body.solid.tet) / THICKENED_TETS) ** (1 / 3)
                with suppress(MeshError):
                    body, edge = at_size(finer, "lattice"), finer
        made = Elements(body, length_m, clamp, degree, thin, edge, anew, modes, simple=simple, skin=skin)
        if given is None:
            made = made.bounded()
    except EndlessError:
        raise
    except MeshError as error:  # coarser than it should be, rather than silent
        if given is not None:
            raise
        report_progress(f"thicker walls stand for its own: {error.what}")
        return coarse_body(THICKENED_TETS)
    if given is not None and made.degree == 3 and made._unknowns > CUBIC_UNKNOWNS:
        made = replace(made, degree=2)
    made.held(lagrange.field(made.solid, 2))
    return made


def _first(
    shapes: tuple[Shape, ...],
    thickness_m: float | None,
    length_m: float,
    tensor: Array,
    wanted: WantedModes,
) -> tuple[float, float, int, bool]:
    """Estimate the wall and the first edge, in m, the number of modes, and whether detail is left out.

    The edge follows the shortest wave of a plate as thick as the body, at the highest λ wanted or at the wave number of
    as many modes as are wanted, with no more unknowns than their work allows.
    """
    per_wave = 0.2  # First edge over the shortest wave
    largest = 0.2  # edge over the diagonal, at most
    skin = skin_of(shapes, thickness_m)
    area = float(geometry.face_areas_m2(skin.vertex_m, skin.face).sum()) / length_m**2
    wall = skin.thickness_m / length_m
    flat = np.sqrt(4 * np.pi * (wanted.most + 8) / (area / 2))
    bulk = (3 * np.pi**2 * (wanted.most + 8) / (area * wall / 2)) ** (1 / 3)  # two shear waves fill a lump
    number = float(polynomials.wave_number(wanted.beyond * wanted.limit, wall, tensor))
    modes = cost.modes_below(number, area, wall, wanted)
    edge = min(per_wave * 2 * np.pi / min(number, max(flat, bulk)), largest)
    thin = edge > wall
    most = min(MOST_UNKNOWNS[thin], int(cost.most_unknowns(cost.MOST_WORK, modes, 3, thin, coarse(thin))))
    least = edge_within_m(area * wall / 2, wall, most / UNKNOWNS_A_TET[3])
    if edge < least:
        report_progress(
            f"elements of {edge * length_m:.2g} m, for the shortest wave wanted, are about {(least / edge) ** 2:.1f} × "
            f"{most} unknowns: larger ones are used, unless edge_m gives their size"
        )
    return wall * length_m, max(edge, least) * length_m, modes, has_detail(skin)
