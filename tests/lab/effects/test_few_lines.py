"""Few, broad lines in noise: which of them may be modes, and what their patterns tell of a tensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.effects import orthotropy
from sonic_bullet.lab.effects.contact_time import propose_contact_time
from sonic_bullet.lab.effects.damping_law import propose_damping_law
from sonic_bullet.lab.effects.evidence import Elastic, ObjectEvidence
from sonic_bullet.lab.effects.orthotropy import propose_orthotropy
from sonic_bullet.lab.effects.orthotropy.tensor_lines import BodyLines, body_lines_of, select_ringing
from sonic_bullet.lab.effects.orthotropy.tensor_search import Tensor, _judge_tensor, isotropic_p
from sonic_bullet.lab.effects.orthotropy.tensors import reduce_numbers
from sonic_bullet.records import Array, Material
from tests.few_cases import parametrize_few
from tests.made.body import recorded, truth

BAND = (50.0, 7_500.0)
# of pulses that are as long by their second moments, times the half-sine's
WIDTH = {"half-sine": 1.0, "hertz": 0.9, "raised-cosine": 0.76}
MATERIAL = Material.isotropic("wood", youngs_pa=1e10, poisson=0.3, density_kg_m3=600)


def elastic(freq_hz: Array, pattern: Array) -> Elastic:
    """A body whose modes stay where they are, whatever the tensor."""
    return Elastic(MATERIAL, True, lambda _: (freq_hz, lambda mode: np.zeros((9, len(mode))), pattern), lambda _: None)  # type: ignore[arg-type,return-value]


def observed(hz: list[float], decay: list[float], amplitude: Array) -> ObjectEvidence:
    """A plate's strikes that hold foreign lines (f,) of these numbers and amplitudes (s, f)."""
    body = recorded()
    one = evidence_of(truth(), (body,), BAND).observed[0]
    return replace(
        one,
        elastic=elastic(np.array(hz), amplitude.real),
        foreign_hz=np.array(hz),
        foreign_decay_per_s=np.array(decay),
        foreign_amplitude=amplitude,
        foreign_sd=np.full(amplitude.shape, 1e-4),
    )


def only(one: ObjectEvidence, lines: int) -> ObjectEvidence:
    """The evidence where no more than the first lines stood above the noise."""
    k = slice(0, lines)
    return replace(
        one,
        freq_hz=one.freq_hz[k],
        decay_per_s=one.decay_per_s[k],
        amplitude=one.amplitude[:, k],
        amplitude_sd=one.amplitude_sd[:, k],
        mode=one.mode[k],
        expected=one.expected[:, k],
        foreign_hz=np.zeros(0),
    )


LONG = (
    (ContactTime(1.9e-3, 0.016, 0.0, "raised-cosine"), 2),
    (ContactTime(1.1e-3, 0.016, 0.0, "half-sine"), 3),
    (ContactTime(1.2e-3, 0.016, -0.2, "hertz"), 3),
)


@parametrize_few(("pulse", "lines"), LONG, 1)
def test_modes_that_nobody_hears_tell_a_long_contact(pulse: ContactTime, lines: int) -> None:
    """A soft hammer leaves two or three lines: a pulse far longer would say as much of those, and one far shorter as
    much of the silence above.
    """
    told = evidence_of(truth(), (recorded(pulse),), BAND)
    found = propose_contact_time(replace(told, observed=(only(told.observed[0], lines),)))
    assert found is not None
    half = [one.duration_s(0.016) * WIDTH[one.pulse] for one in (found, pulse)]
    assert half[0] == pytest.approx(half[1], rel=0.12)


def test_few_lines_of_a_sharp_blow_tell_no_contact_time() -> None:
    told = evidence_of(truth(), (recorded(),), BAND)
    loud = replace(told.observed[0], noise=np.full(5, 0.1), floor=None)  # so loud that silence says nothing
    assert propose_contact_time(replace(told, observed=(only(loud, 3),))) is None


def test_what_is_gone_within_a_period_or_keeps_no_phase_is_no_mode() -> None:
    turn = np.exp(1j * np.array([0.3, 1.9, -2.2, 1.1, -1.3]))
    still = np.array([1.0, -0.5, 0.7, -0.9, 0.4]) + 0j
    one = observed([20.0, 60.0, 900.0, 1200.0], [60.0, 20.0, 50.0, 50.0], np.stack([still, still, turn, still], axis=1))
    assert select_ringing(one).tolist() == [False, True, False, True]


def test_broad_lines_are_worth_less() -> None:
    still = np.array([1.0, -0.5, 0.7, -0.9, 0.4]) + 0j
    one = observed([900.0, 601.0, 613.0], [5.0, 20.0, 120.0], np.stack([still] * 3, axis=1))
    told = body_lines_of(replace(evidence_of(truth(), (recorded(),), BAND), observed=(one,)))[0]
    narrow, broad = (told.worth[int(np.argmin(np.abs(told.log_hz - np.log(f))))] for f in (601.0, 613.0))
    assert broad < 0.8 * narrow


def test_patterns_speak_where_frequencies_agree() -> None:
    """Two bodies with the same frequencies; only one has the lines' patterns."""
    rng = np.random.default_rng(0)
    hz, shape = np.geomspace(800, 3000, 5), rng.standard_normal((5, 5))

    def judged(pattern: Array) -> Tensor:
        told = BodyLines(
            np.log(hz), np.full(5, 1e-4), np.full(5, 0.5), shape + 0j, np.arange(-5, 0), elastic(hz, pattern)
        )
        start = isotropic_p(told.elastic)
        return _judge_tensor([told], "isotropic", reduce_numbers("isotropic", start), start)

    right, wrong = judged(shape), judged(rng.standard_normal((5, 5)))
    assert right.bic < wrong.bic - 10


def test_a_part_of_the_lines_fits_the_same_law_again() -> None:
    law = DampingLaw("power", 6e-3, 1.4)
    told = evidence_of(truth(), (recorded(law),), BAND)
    for seed in range(4):
        again = propose_damping_law(
            replace(thin_evidence(told, (told.observed[0].source, seed), 0.4, np.random.default_rng(seed)), known=law)
        )
        assert again is not None and again.law == "power"
        assert again.exponent == pytest.approx(1.4, abs=0.15)


@pytest.mark.parametrize(("gain", "matched", "off", "dry", "named"), [
    (150.0, 0.51, 0.0079, True, True),  # a slab in a room: half of its lines are no modes, whatever the tensor
    (150.0, 0.51, 0.0079, False, False),  # outside a room lines that stay off are another effect's
    # a line more, and all the others' patterns: whether it sounds nearer, too, is for its trial to tell
    (64.0, 0.40, 0.0097, True, True),
    (64.0, 0.27, 0.0097, True, False),  # patterns alone, without a line more
    (20.0, 0.51, 0.0079, True, False),
    (150.0, 0.95, 0.0010, False, True),
])  # fmt: skip
def test_in_a_room_a_tensor_must_place_a_line_more_and_need_not_place_all(
    gain: float, matched: float, off: float, dry: bool, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    hz = [410.0, 700.0, 1110.0, 1630.0, 2410.0, 3050.0, 4100.0]
    one = replace(observed(hz, [30.0] * len(hz), np.ones((5, len(hz)), complex)), dry=dry)
    plain = Tensor(
        "isotropic", isotropic_p(elastic(np.array(hz), np.ones((5, len(hz))))), -600.0, 0.004, 0.27, (), 0.0105
    )
    stiff = plain.p + np.array([0.5, -0.5, 0, 0, 0, 0, 0, 0, 0])
    monkeypatch.setattr(
        orthotropy, "search", lambda _: (plain, Tensor("orthorhombic", stiff, -600.0 - gain, 0.003, matched, (), off))
    )
    monkeypatch.setattr(orthotropy, "_fits", lambda _: False)
    assert (propose_orthotropy(replace(evidence_of(truth(), (), BAND), observed=(one,))) is not None) == named


def test_lines_and_shifted_modes_have_in_common_what_counting_through_finds() -> None:
    """Σ over pairs, each as far as they are near, over what modes have in common with themselves."""
    from sonic_bullet.lab.effects.orthotropy.tensor_lines import Seen
    from sonic_bullet.lab.effects.orthotropy.tensor_search import SIEVE_REACH, SIEVE_WIDTH, _agreement

    rng = np.random.default_rng(4)
    lines, modes = np.sort(rng.uniform(6, 9, 14)), np.sort(rng.uniform(6, 9, 22))
    told = BodyLines(lines, np.full(14, 1e-3), rng.uniform(0.3, 1, 14), None, np.arange(0), elastic(modes, modes))
    seen = Seen(modes, None, rng.uniform(0, 1, (14, 22)))  # type: ignore[arg-type]
    first, shift = rng.uniform(0.2, 1, 14), np.arange(-SIEVE_REACH, SIEVE_REACH, SIEVE_WIDTH / 2)
    direct = []
    for one in shift:
        place = modes + one / 2
        worth = np.interp(place, lines, first, 0.0, 0.0)
        near = np.exp(-0.5 * ((lines[:, None] - place) / SIEVE_WIDTH) ** 2)
        shared = (told.worth[:, None] * first[:, None] * seen.alike**2 * near * worth).sum()
        own = worth @ np.exp(-0.5 * ((place[:, None] - place) / SIEVE_WIDTH) ** 2) @ worth
        direct.append(shared / np.sqrt(max(own, 1.0)))
    assert _agreement(told, seen, first, shift) == pytest.approx(np.array(direct), rel=1e-3, abs=1e-5)
