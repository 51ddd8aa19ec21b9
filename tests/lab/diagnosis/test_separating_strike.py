"""The strike that separates two models: where they differ most, and nowhere where they are one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.lab.diagnosis import separating_strike as module
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.score import Comparable
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate
from sonic_bullet.lab.diagnosis.selection.stepwise import SelectionEnd
from tests.made.body import ALPHA, BETA, GAIN, recorded

PLAIN = Hypothesis(ALPHA, BETA, GAIN)


def ended(named: Effect, rival: Effect | None = None) -> SelectionEnd:
    """A selection that named one effect, and tried another, which strikes left out do not tell from it."""
    takes = Comparable(takes_of((recorded(),)))
    after = replace(PLAIN, effects=(named,))
    added = Candidate(named.id, named, after, np.ones(5), 1.0, 0.0, {})
    tried = [replace(added, id=e.id, effect=e, hypothesis=replace(PLAIN, effects=(e,))) for e in (rival,) if e]
    return SelectionEnd(PLAIN, after, (added,), tuple(tried), "explained", 3.0, 1.0, 1.0, 0.0, (), takes, ())


def test_what_goes_with_level_is_told_by_the_hardest_strike_and_not_by_the_softest() -> None:
    """Equal models lie nowhere apart; what vanishes with the level does so with the strike."""
    end = _doubtful(AmplitudeDamping(0.5, "velocity"))
    found = module.separating_strike(end)
    assert found is not None and found.times == max(module.TIMES)
    assert found.models == ("no effect", "amplitude-damping")
    assert found.apart_db > 2 * found.apart_so_far_db > 0
    assert "four times as hard as the middle strike (" in str(found) and "N·s)" in str(found)
    take = next(t for t in module._one_a_place(end.judged))
    one, other = (predict(h, take.body) for h in (end.after, end.tried[0].hypothesis))
    assert module._apart_db(take, one, other, 1e-6) == pytest.approx(0.0, abs=1e-2)
    assert module._apart_db(take, one, one, 0.05) == 0.0


def _doubtful(effect: Effect) -> SelectionEnd:
    """Nothing named; an effect of which strikes left out say neither yes nor no."""
    end = ended(effect)
    unclear = replace(end.added[0], drop_db=np.array([1.0, -1.0, 0.5, -0.5, 0.1]))
    return replace(end, after=PLAIN, added=(), tried=(unclear,))


def test_what_these_strikes_tell_apart_is_not_proposed() -> None:
    """By strikes left out, for or against; or as one of the two alone could have sounded so."""
    end = _doubtful(AmplitudeDamping(0.5, "velocity"))
    for gain in (1.0, -1.0):
        clear = replace(end.tried[0], drop_db=np.full(5, gain))
        assert module.separating_strike(replace(end, tried=(clear,))) is None
    assert module.separating_strike(_doubtful(AmplitudeDamping(90.0, "velocity"))) is None


def test_a_pulse_and_a_filter_of_its_length_are_told_by_another_strength() -> None:
    """Hertz' pulse goes with the impulse, a filter does not [Johnson 1985, eq. 11.24]."""
    tau = 4e-4
    end = ended(ContactTime(tau, 0.02, -0.2, "half-sine"), MeasurementChain(low_pass_hz=0.6 / tau, low_order=2))
    body = replace(recorded(), impulse_n_s=np.full(5, 0.02))  # so far all as hard
    end = replace(end, judged=Comparable(takes_of((body,))), after_db=end.floor_db + 3.0)  # left open
    found = module.separating_strike(end)
    assert found is not None and found.models == ("contact-time", "measurement-chain")
    assert found.times != 1.0 and found.apart_db > found.apart_so_far_db
    assert "contact-time and measurement-chain lie" in str(found)


def test_without_two_models_there_is_nothing_to_separate() -> None:
    end = ended(AmplitudeDamping(9.0, "velocity"))
    assert module.separating_strike(replace(end, added=(), after=PLAIN)) is None
