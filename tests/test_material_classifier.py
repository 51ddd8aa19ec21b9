"""The benchmark's features know no gain, and no object is named by what was learnt from it."""

from __future__ import annotations

import numpy as np

from studies.material_classifier import CENTRES_HZ, FLOOR_DB, Heard, features_of, learn, names_of, unheard_names


def test_gain_moves_no_feature_and_a_tone_lies_in_its_octave() -> None:
    sr = 16_000
    tone = np.sin(2 * np.pi * 1000 * np.arange(sr) / sr) * np.exp(-np.arange(sr) / sr / 0.05)
    found = features_of(tone, sr).reshape(len(CENTRES_HZ), -1)
    assert np.allclose(features_of(1e3 * tone, sr).reshape(found.shape), found)
    assert (found.argmax(axis=0) == list(CENTRES_HZ).index(1000)).all()
    # 20 log10 e a time constant of the amplitude: windows of 40 and 80 ms, 20 to 60 and 60 to 140 ms after the onset
    energy = np.exp(-2 * np.array([0.02, 0.06, 0.14]) / 0.05)
    fall = 10 * np.log10((energy[0] - energy[1]) / (energy[1] - energy[2]))
    assert np.isclose(found[2, 1] - found[2, 2], fall, atol=0.2) and found.min() >= FLOOR_DB


def test_an_object_is_named_by_the_others() -> None:
    """Each object has a feature of its own, which tells its material only to what has learnt from it."""
    draw = np.random.default_rng(0)
    heard = [
        Heard(
            10.0 * np.eye(4)[number % 4] + 0.01 * draw.normal(size=4),
            "metal" if number % 2 else "wood",
            str(number % 4),
        )
        for number in range(40)
    ]
    assert names_of(learn(heard), heard) == [one.material for one in heard]
    said = unheard_names(heard, heard)
    assert np.mean([name == one.material for name, one in zip(said, heard, strict=True)]) < 0.75  # chance is a half
