"""Steps kept as rows are the steps that were given, whole, sliced, one by one, and from a file."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet import files
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.rows import log_steps
from sonic_bullet.files.rows.log_steps import LogSteps, StepLog
from sonic_bullet.files.storage import container, spool
from sonic_bullet.records.contacts import CONTACT, ROW_FIELDS, Contacts, Step
from sonic_bullet.records.errors import FileError, LogError
from tests.made.logs import log, same, turns


def steps_in_which_bodies_go(count: int) -> tuple[Step, ...]:
    """Steps of up to four bodies, of which some have gone for good, with contacts among those that are there."""
    rng, made = np.random.default_rng(3), []
    for i in range(count):
        body = np.array([x for x in range(4) if i < count // (x + 1) or x == 3])
        k = int(rng.integers(0, 4))
        rows = {name: rng.normal(size=(k, *tail)) for name, (_, tail) in ROW_FIELDS.items()}
        rows["a"], rows["b"] = rng.choice(body, k), rng.choice(body, k)
        b = len(body)
        poses = rng.normal(size=(b, 3)), turns(rng, b), rng.random(b) < 0.5
        made.append(Step(1 / (100 + i), *poses, Contacts(**rows), rng.normal(size=3), body))
    return tuple(made)


@pytest.fixture(params=[False, True], ids=["few", "many"])
def small_blocks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks, batches and memory so small that twenty steps cross all of them."""
    if request.param:
        for name, value in {"PACKED": 3, "BLOCK_STEPS": 4, "BLOCK_ROWS": 9}.items():
            monkeypatch.setattr(log_steps, name, value)
        monkeypatch.setattr(spool, "MEMORY_BYTES", 500)
        monkeypatch.setattr(spool, "BLOCK_BYTES", 300)
        monkeypatch.setattr(container, "LOADED_BYTES", 200)


@pytest.mark.usefixtures("small_blocks")
def test_steps_come_back_and_slices_are_those_of_a_tuple() -> None:
    given = steps_in_which_bodies_go(23)
    kept = LogSteps.of(given)
    assert same(kept, given) and same(tuple(kept[i] for i in range(-23, 23)), given + given)
    for cut in (slice(None), slice(5, 17), slice(-4, None), slice(9, 3), slice(20, 99), slice(None, None, 3)):
        assert same(tuple(kept[cut]), given[cut])
    assert same(tuple(kept[4:20][3:9]), given[7:13])
    assert len(kept[4:20]) == 16 and kept[4:20].row_counts[1] == sum(len(one.contacts) for one in given[4:20])
    assert not kept[5:5] and kept[22:]
    with pytest.raises(IndexError):
        kept[23]
    assert kept.bodies() == 4


@pytest.mark.usefixtures("small_blocks")
def test_a_snapshot_stays_what_it_was() -> None:
    given, growing, snapshots = steps_in_which_bodies_go(20), StepLog(), []
    for step in given:
        growing.append(step)
        snapshots.append(growing.steps())
    for count, one in enumerate(snapshots, 1):
        assert same(tuple(one), given[:count])


def test_a_snapshot_reads_no_row_of_the_steps_before_it() -> None:
    class Unreadable:
        def __len__(self) -> int:
            return 10**9

        def __getitem__(self, rows: slice) -> np.ndarray:
            raise AssertionError("a row was read")

    steps = LogSteps(*[Unreadable()] * 4, 0, 10**9, 2, [0, ()])
    assert len(ContactLog(log().bodies, steps, (), 48_000, 0).steps) == 10**9


@pytest.mark.usefixtures("small_blocks")
def test_columns_of_a_log_are_those_of_its_steps() -> None:
    given = steps_in_which_bodies_go(23)
    made = replace(log(), steps=given, events=())
    counts = [len(one.contacts) for one in given]
    assert len(made) == sum(counts) and made.duration_s == float(np.sum([one.dt_s for one in given]))
    assert (made.start_s == np.append(0.0, np.cumsum([one.dt_s for one in given]))[:-1]).all()
    assert (made.step == np.repeat(np.arange(23), counts)).all()
    assert made.rows.row.tobytes() == Contacts.join([one.contacts for one in given]).row.tobytes()
    assert same(tuple(made.first(9).steps), given[:9])
    with pytest.raises(LogError, match="body that the log has not"):
        replace(made, bodies=made.bodies[:3])


@pytest.mark.usefixtures("small_blocks")
def test_a_log_of_bodies_that_go_is_written_and_read_by_blocks(tmp_path: Path) -> None:
    written = replace(log(), steps=steps_in_which_bodies_go(23))
    files.write_log(tmp_path / "a.npz", written)
    read = files.read_log(tmp_path / "a.npz")
    assert same(read, written)
    files.write_log(tmp_path / "a.npz", read)  # over the very file that its rows lie in
    assert same(read, written) and same(files.read_log(tmp_path / "a.npz"), written)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize(
    ("entry", "value", "words"),
    [
        ("pose_body", None, "missing"),
        ("pose_body", np.array([0, 1, 2, 2] * 9, np.int32), "do not ascend"),
        ("pose_body", np.array([0, 1, 2, 5] * 9, np.int32), "body that the log has not"),
        ("pose_body", np.array([-1, 1, 2, 3] * 9, np.int32), "body that the log has not"),
        ("contact_a", np.array([0, 1, 3, 0] * 9, np.int32), "the step does not know"),
        ("contact_b", np.full(36, -1, np.int32), "below zero"),
        ("contact_b", np.full(36, 9, np.int32), "the step does not know"),
        ("pose_quaternion_xyzw", np.full((36, 4), np.nan), "quaternion_xyzw holds NaN"),
        ("contact_gap_m", np.full(36, 1e40), "gap_m holds a number"),
    ],
)
def test_forged_rows_are_refused(tmp_path: Path, entry: str, value: np.ndarray | None, words: str) -> None:
    """Of nine steps in which body 0, 1, 2 and 4 are, with four contacts each; 3 has gone."""
    poses = np.zeros((4, 3)), np.zeros((4, 4)), np.zeros(4, bool)
    rows = Contacts.of(np.zeros(4, CONTACT))
    steps = tuple(Step(0.01, *poses, rows, np.zeros(3), np.array([0, 1, 2, 4])) for _ in range(9))
    bodies = (*log().bodies, log().bodies[0])
    files.write_log(tmp_path / "good.npz", replace(log(), bodies=bodies, steps=steps))
    with zipfile.ZipFile(tmp_path / "good.npz") as source, zipfile.ZipFile(tmp_path / "bad.npz", "w") as target:
        for name in source.namelist():
            stream = io.BytesIO(source.read(name))
            if name == f"{entry}.npy" and value is not None:
                stream = io.BytesIO()
                np.save(stream, value)
            if name != f"{entry}.npy" or value is not None:
                target.writestr(name, stream.getvalue())
    with pytest.raises(LogError, match=words) as caught:
        files.read_log(tmp_path / "bad.npz")
    assert "bad.npz" in str(caught.value)


@pytest.mark.parametrize("lazy", [False, True])
def test_a_flipped_byte_of_a_row_is_refused_where_rows_stay_in_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lazy: bool
) -> None:
    monkeypatch.setattr(container, "LOADED_BYTES", 64 if lazy else 1 << 30)
    files.write_log(tmp_path / "a.npz", log())
    whole = (tmp_path / "a.npz").read_bytes()
    at = whole.index(b"pose_position_m.npy") + 200
    (tmp_path / "a.npz").write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with pytest.raises(LogError, match=r"a\.npz.*(damaged|CRC)"):
        files.read_log(tmp_path / "a.npz")


def test_a_file_that_is_cut_while_its_rows_are_in_use_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(container, "LOADED_BYTES", 64)
    files.write_log(tmp_path / "a.npz", log())
    read = files.read_log(tmp_path / "a.npz")
    with open(tmp_path / "a.npz", "r+b") as file:
        file.truncate(100)
    with pytest.raises(FileError, match="it was cut while it was in use"):
        tuple(read.steps)


@pytest.mark.parametrize("cut", [None, 30, 80])
def test_a_directory_beyond_4_gib_is_read_and_nothing_hides_behind_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cut: int | None
) -> None:
    """The end record of a file past 4 GiB is of another kind (zip64); here its limit is set low."""
    monkeypatch.setattr(zipfile, "ZIP64_LIMIT", 100)
    files.write_log(tmp_path / "a.npz", log())
    whole = (tmp_path / "a.npz").read_bytes()
    assert b"PK\x06\x06" in whole and b"PK\x06\x07" in whole
    if cut is None:
        assert same(files.read_log(tmp_path / "a.npz"), log())
        return
    (tmp_path / "a.npz").write_bytes(whole[:-cut] + bytes(7) + whole[-cut:])
    with pytest.raises(LogError, match=r"a\.npz"):
        files.read_log(tmp_path / "a.npz")
