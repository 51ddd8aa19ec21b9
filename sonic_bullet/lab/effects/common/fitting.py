"""The search over effects' numbers, each within the range that its caller declares.

search_number: the least of a grid, then between its neighbours                    [Brent 1973, ch. 5]
search_numbers: a simplex of declared steps about a start                          [Nelder & Mead 1965]
search_places: the same over places of a surface beside numbers
fit_numbers: least squares under Cauchy's loss, over declared fields of an effect  [Holland & Welsch 1977]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from sonic_bullet.effects.common.declared_numbers import signed_fields
from sonic_bullet.effects.common.points import vertex_normals
from sonic_bullet.lab.effects.common.line_likelihood import DECAY_SCALE
from sonic_bullet.records import Array, ModalModel

Fitted = TypeVar("Fitted", bound=Any)  # a dataclass
Trial = TypeVar("Trial", bound=tuple[Any, ...])


def search_number(
    cost: Callable[[float], float],
    grid: Array,
    tolerance: float = 1e-3,
    costs: Callable[[Array], Array] | None = None,
) -> tuple[float, float]:
    """Find the least cost over a number: (cost, number).

    Parameters
    ----------
    cost : callable
        Of the number.
    grid : (n,)
        Numbers, ascending, close enough that the least of all minima is beside the best of them; between positive ones
        the search goes by the logarithm.
    tolerance : float
        Of the number, over the distance of the best one's neighbours.
    costs : callable
        Of all numbers of the grid at once, where that is cheaper than one after another.
    """
    from scipy.optimize import minimize_scalar

    on_grid = [cost(x) for x in grid.tolist()] if costs is None else costs(grid).tolist()
    i = int(np.argmin(on_grid))
    scale, number = (np.log, np.exp) if grid[0] > 0 else (np.positive, np.positive)
    ends = scale(grid[[max(i - 1, 0), min(i + 1, len(grid) - 1)]])
    options = {"xatol": tolerance * float(ends[1] - ends[0])}
    found = minimize_scalar(lambda x: cost(float(number(x))), bounds=ends, method="bounded", options=options)
    return min((float(found.fun), float(number(found.x))), (on_grid[i], float(grid[i])))


def search_numbers(cost: Callable[[Array], float], start: Array, step: Array, most: int = 120) -> tuple[float, Array]:
    """Find the minimum (cost, numbers) near a start (p,), by steps (p,) and at most so many trials."""
    from scipy.optimize import minimize

    simplex = start + np.concatenate([np.zeros((1, len(start))), np.diag(step)])
    options = {"initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-6, "maxfev": most}
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    return float(found.fun), found.x


def search_places(
    trial: Callable[[tuple[int, ...], Array], Trial],
    x: ModalModel,
    vertex: tuple[int, ...],
    start: Array,
    step: Array,
    reach_m: float,
    most: int = 40,
) -> Trial:
    """Find the trial of the least cost near a start, over places of a surface and numbers.

    A place is the surface's vertex nearest to a point of the tangent plane at the start.

    Parameters
    ----------
    trial : callable
        Of vertices (j,) and numbers (p,): a tuple, its cost first.
    x : ModalModel
        The body.
    vertex, start : (j,), (p,)
        To start from.
    step : (p,)
        Of the numbers.
    reach_m : float
        Step of the places.
    most : int
        Trials at most.
    """
    from scipy.spatial import KDTree

    body, at = np.unique(x.face), x.vertex_m[list(vertex)]
    tree, count = KDTree(x.vertex_m[body]), 2 * len(vertex)
    tangent = np.linalg.svd(vertex_normals(x)[list(vertex)][:, None])[2][:, 1:]
    made: list[Trial] = []

    def cost(z: Array) -> float:
        point = at + reach_m * np.einsum("ja,jax->jx", z[:count].reshape(-1, 2), tangent)
        made.append(trial(tuple(body[tree.query(point)[1]].tolist()), start + step * z[count:]))
        return float(made[-1][0])

    begin = np.zeros(count + len(start))
    search_numbers(cost, begin, np.ones(len(begin)), most)
    return min(made, key=lambda one: one[0])


def fit_numbers(start: Fitted, free: Sequence[str], residual: Callable[[Fitted], Array]) -> tuple[float, Fitted]:
    """Fit fields of an effect: (twice the cost, effect).

    Parameters
    ----------
    start : dataclass
        To start from.
    free : sequence of str
        The fields; those that may not be negative by their declarations are fitted in their logarithms.
    residual : callable
        Effect -> residuals (n,) in spreads.
    """
    from scipy.optimize import least_squares

    signed = np.isin(free, list(signed_fields(start.__class__)))
    first = np.array([vars(start)[name] for name in free])

    def made(x: Array) -> Fitted:
        values: dict[str, Any] = dict(zip(free, np.where(signed, x, np.exp(x)).tolist(), strict=True))
        return replace(start, **values)

    begin = np.where(signed, first, np.log(np.where(signed, 1.0, first)))
    found = least_squares(lambda x: residual(made(x)), begin, loss="cauchy", f_scale=DECAY_SCALE, bounds=(-40, 40))
    return float(2 * found.cost), made(found.x)
