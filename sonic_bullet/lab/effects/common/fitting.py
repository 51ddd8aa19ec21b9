"""The optimiser of effects' numbers: from starts to the nearest minimum of a misfit that is robust against outliers.

bracket: the least of a grid, then between its neighbours in ln x             [Brent 1973, ch. 5]
nearby: a simplex of declared steps about a start                             [Nelder & Mead 1965]
fitted: least squares under Cauchy's loss, over declared fields of an effect  [Holland & Welsch 1977]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from sonic_bullet.effects.common.declared_numbers import signed_fields
from sonic_bullet.records import Array

Fitted = TypeVar("Fitted", bound=Any)  # a dataclass


def bracket(cost: Callable[[float], float], grid: Array) -> tuple[float, float]:
    """Find the least cost over a positive number: (cost, number), from the best of an ascending grid."""
    from scipy.optimize import minimize_scalar

    costs = [cost(x) for x in grid.tolist()]
    i = int(np.argmin(costs))
    ends = np.log(grid[[max(i - 1, 0), min(i + 1, len(grid) - 1)]])
    found = minimize_scalar(lambda x: cost(float(np.exp(x))), bounds=ends, method="bounded", options={"xatol": 1e-4})
    return min((float(found.fun), float(np.exp(found.x))), (costs[i], float(grid[i])))


def nearby(cost: Callable[[Array], float], start: Array, step: Array, most: int = 120) -> tuple[float, Array]:
    """Find the minimum (cost, numbers) near a start (p,), by steps (p,) and at most so many trials."""
    from scipy.optimize import minimize

    simplex = start + np.concatenate([np.zeros((1, len(start))), np.diag(step)])
    options = {"initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-6, "maxfev": most}
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    return float(found.fun), found.x


def fitted(start: Fitted, free: Sequence[str], residual: Callable[[Fitted], Array]) -> tuple[float, Fitted]:
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
    found = least_squares(lambda x: residual(made(x)), begin, loss="cauchy", f_scale=2.0, bounds=(-40, 40))
    return float(2 * found.cost), made(found.x)
