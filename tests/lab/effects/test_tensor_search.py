"""A tensor far from isotropy, sought among the lines of a made body whose λ are sums of its constants, as any body's
are.
"""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.effects.evidence import Elastic, Evidence
from sonic_bullet.lab.effects.orthotropy import tensor_search
from sonic_bullet.lab.effects.orthotropy.tensor_lines import BodyLines
from sonic_bullet.lab.effects.orthotropy.tensor_search import (
    LINE_CAP,
    TENSOR_STEP,
    TENSOR_WIDTHS,
    _search_neighbours,
    fit_tensor,
    isotropic_p,
    search,
)
from sonic_bullet.lab.effects.orthotropy.tensors import constants, stiffness
from sonic_bullet.records import ORTHOTROPIC, Array, Material
from tests.few_cases import parametrize_few

MODES, STRIKES, LINES = 90, 5, 60
EVIDENCE = Evidence((), 0.0, 0.0, 1.0, (), (20.0, 20_000.0))
MATERIAL = Material.isotropic("plank", youngs_pa=4e9, poisson=0.3, density_kg_m3=600)


def plank(seed: int) -> Elastic:
    """Modes whose λ is each a share of every constant: λ_j = Σ_i w_ij C_i, w ≥ 0, ever higher ones."""
    rng = np.random.default_rng(seed)
    share = rng.dirichlet(np.full(9, 0.35), MODES).T * np.array([1, 1, 1, 0.3, 0.3, 0.3, 1, 1, 1])[:, None]
    share = share * np.cumsum(rng.uniform(0.4, 1.6, MODES)) ** 2
    pattern = rng.standard_normal((STRIKES + 1, MODES))

    def look(stiff: Array) -> tuple[Array, object, Array]:
        value = np.array([stiff[i, j] for i, j in ORTHOTROPIC]) @ share
        order = np.argsort(value)
        return np.sqrt(value[order]) / (2 * np.pi), lambda mode: (share / value)[:, order[mode]], pattern[:, order]

    return Elastic(MATERIAL, True, look, lambda _: None)  # type: ignore[arg-type,return-value]


def far(seed: int) -> Array:
    """p (9,) of a wood: stiff along, softer across, soft to shear."""
    rng = np.random.default_rng(100 + seed)
    along = np.log(1.2e10 / 600)
    across = along + np.log(np.array([1.0, rng.uniform(0.08, 0.14), rng.uniform(0.04, 0.08)]))
    goes = 0.5 * np.array([across[1] + across[2], across[0] + across[2], across[0] + across[1]])
    return np.concatenate([across, rng.uniform(0.1, 0.3, 3), goes - np.log(2.6) + rng.uniform(-0.4, 0.0, 3)])


def lines(seed: int) -> BodyLines:
    """The lowest LINES modes of a plank, each 0.1 % off."""
    body, rng = plank(seed), np.random.default_rng(200 + seed)
    freq, _, pattern = body.look(stiffness(far(seed)))
    log_hz = np.log(freq[:LINES]) + 1e-3 * rng.standard_normal(LINES)
    amplitude = pattern[:STRIKES, :LINES] * (1 + 0.05 * rng.standard_normal((STRIKES, LINES)))
    return BodyLines(
        log_hz, np.full(LINES, 1e-4), np.full(LINES, 0.5), amplitude + 0j, np.arange(STRIKES) - (STRIKES + 1), body
    )


@parametrize_few("seed", range(3), 1)
def test_a_wood_is_told_from_an_isotropic_start(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tensor_search, "body_lines_of", lambda _: [lines(seed)])
    both = search(EVIDENCE)
    assert both is not None and both[1].off < 2e-3, "as near as the lines are told"
    assert np.abs(constants(both[1].p) / constants(far(seed)) - 1)[[0, 1, 6, 7, 8]].max() < 0.1


@pytest.mark.slow
@parametrize_few("seed", range(3), 1)
def test_steps_to_either_side_lead_out_of_an_end_whose_upper_pairs_are_wrong(seed: int) -> None:
    told, guess = [lines(seed)], isotropic_p(plank(seed))
    rng = np.random.default_rng(seed)
    ends = [
        fit_tensor(
            told,
            "orthorhombic",
            far(seed) + TENSOR_STEP * rng.choice([-1.5, 1.5], 9) * (np.arange(9) // 3 != 1),
            guess,
            TENSOR_WIDTHS[4:],
        )
        for _ in range(5)
    ]
    wrong = [end for end in ends if end.off > 0.3 * LINE_CAP]
    assert wrong
    near = [_search_neighbours(told, end, guess) for end in wrong]
    assert all(b.bic <= a.bic for a, b in zip(wrong, near, strict=True))
    assert sum(end.off < 2e-3 for end in near) >= 2, (
        "as near as the lines are told, from some; those are the ones that are taken"
    )
