"""Stems: what each body sends, of the contacts of the mix; together they are the mix."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.apps.soundtrack.stems import Stem, render_stems, stem_name, write_stems
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import read_audio, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Microphone, Vibrometer
from sonic_bullet.records.errors import AudioError, FileError
from tests.few_cases import parametrize_few
from tests.made.disks import full_disk
from tests.made.soundtracks import table_log


@pytest.fixture(scope="module")
def log() -> ContactLog:
    return table_log()


@pytest.fixture(scope="module")
def stems(log: ContactLog) -> tuple[Stem, ...]:
    return render_stems(log)


def test_the_stems_add_up_to_the_mix(log: ContactLog, stems: tuple[Stem, ...]) -> None:
    mix = render_log(log)
    total = sum(stem.sound.samples() for stem in stems)
    assert np.abs(total - mix).max() <= 1e-12 * np.abs(mix).max()
    sounding = [stem for stem in stems if stem.sound.peaks().max() > 1e-6]
    assert len(sounding) == 5
    assert all(np.abs(stem.sound.samples() - mix).max() > 1e-3 for stem in stems)


@parametrize_few("sr", [8000, 44_100], 1)
def test_they_do_at_other_rates_and_for_other_sensors(log: ContactLog, sr: int) -> None:
    listening = replace(log, sensors=(Microphone([0, 0, 1]), Vibrometer(1, [0.09, 0.04, 0.005], [0, 0, 1])))
    mix, stems = render_log(listening, sr=sr), render_stems(listening, sr=sr)
    total = sum(stem.sound.samples() for stem in stems)
    assert (np.abs(total - mix).max(axis=1) <= 1e-12 * np.abs(mix).max(axis=1)).all()
    own = [stem for stem in stems if stem.sound.peaks()[1] > 0]
    assert [log.bodies[stem.index].body_id for stem in own] == [1]


def test_a_stem_is_what_its_body_sends_and_not_what_strikes_it(log: ContactLog, stems: tuple[Stem, ...]) -> None:
    """Without modes and volume of all others, contacts being the same, the mix is the stem."""
    chosen = next(stem for stem in stems if log.bodies[stem.index].name == "marble")
    mute = tuple(
        body if i == chosen.index or body.model is None
        else replace(body, volume_m3=0.0, model=replace(body.model, shape=np.zeros_like(body.model.shape)))
        for i, body in enumerate(log.bodies)
    )  # fmt: skip
    alone = render_log(replace(log, bodies=mute))
    found = chosen.sound.samples()
    assert np.abs(alone - found).max() < 0.05 * np.abs(found).max()


def test_a_body_that_comes_and_one_that_goes_are_silent_before_and_ring_on_after(
    log: ContactLog, stems: tuple[Stem, ...]
) -> None:
    by_name = {stem.index: stem.sound.samples() for stem in stems}
    late = max(i for i, body in enumerate(log.bodies) if body.since_step == 60 and body.model is not None)
    goes = next(i for i, body in enumerate(log.bodies) if body.until_step == 90)
    at = 60 * 200
    assert not by_name[late][:, :at].any() and by_name[late][:, at:].any()
    assert by_name[goes][:, 90 * 200 : 100 * 200].any()


def test_pieces_name_their_bodies(log: ContactLog) -> None:
    frames = 0
    for body, frame in render_per_body(log):
        assert frame.shape[:2] == (len(body), 2)
        assert (np.diff(body) > 0).all()
        frames += frame.shape[2]
    assert frames == render_log(log).shape[1]


def test_files_have_one_gain_and_add_up_in_float32(tmp_path: Path, log: ContactLog, stems: tuple[Stem, ...]) -> None:
    mix = write_audio(tmp_path / "mix.wav", render_log(log), log.sr, peak_dbfs=-1)
    reports = list(write_stems(tmp_path / "stems", stems, log.sr, gain_per_pa=mix.gain_per_pa))
    assert [report.gain_per_pa for report in reports] == pytest.approx([mix.gain_per_pa] * 5, rel=1e-12)
    sounds = [read_audio(report.path)[0] for report in reports]
    whole = read_audio(tmp_path / "mix.wav")[0]
    peak = max(float(np.abs(sound).max()) for sound in (*sounds, whole))
    assert np.abs(sum(sounds) - whole).max() <= 2**-23 * len(sounds) * peak


def test_each_has_its_own_peak_where_that_is_asked(tmp_path: Path, log: ContactLog, stems: tuple[Stem, ...]) -> None:
    silent = replace(stems[0], sound=type(stems[0].sound).of(np.zeros((2, 100))))
    for report in write_stems(tmp_path, [*stems[1:], silent], log.sr, peak_dbfs=-6):
        peak = float(np.abs(soundfile.read(report.path)[0]).max())
        assert peak == pytest.approx(0 if Path(report.path).name.startswith("00") else 10 ** (-6 / 20), rel=1e-6)


@pytest.mark.parametrize(
    "name", ["", "..", "/", "a/b", "con", "x" * 300, "\ud800", "名前" * 100, "a\0b", "~", "*?|<>:", " ", "body\n2"]
)
def test_every_name_becomes_a_file_of_its_own(tmp_path: Path, name: str) -> None:
    names = [stem_name(index, name) for index in range(3)]
    assert len(set(names)) == 3
    for one in names:
        (tmp_path / f"{one}.wav").write_bytes(b"")
    assert len(list(tmp_path.iterdir())) == 3


def test_without_a_microphone_there_is_nothing_to_hear(log: ContactLog) -> None:
    with pytest.raises(AudioError, match="microphone"):
        render_stems(replace(log, sensors=()))


def test_a_folder_that_cannot_be_made_and_a_full_disk_are_one_line(
    tmp_path: Path, log: ContactLog, stems: tuple[Stem, ...]
) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(FileError, match="cannot make the folder"):
        list(write_stems(tmp_path / "file" / "stems", stems, log.sr))
    with full_disk(50_000), pytest.raises(FileError, match="cannot write"):
        list(write_stems(tmp_path / "stems", stems, log.sr))
    assert list((tmp_path / "stems").iterdir()) == []


def test_a_full_disk_at_the_fourth_stem_leaves_three(tmp_path: Path, log: ContactLog, stems: tuple[Stem, ...]) -> None:
    four = [replace(stems[k % len(stems)], name=f"{k:02d}-body") for k in range(4)]
    reports = write_stems(tmp_path, four, log.sr)
    finished = [next(reports) for _ in range(3)]
    with full_disk(50_000), pytest.raises(FileError, match=r"cannot write .*03-body\.wav"):
        next(reports)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["00-body.wav", "01-body.wav", "02-body.wav"]
    for stem, report in zip(four, finished, strict=False):
        assert soundfile.info(report.path).frames == stem.sound.shape[1]
