"""What is written is taken, once and in order, however it is cut up, by two threads too."""

from __future__ import annotations

import threading
import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sonic_bullet.session.live.sample_queue import SampleQueue


@given(st.integers(1, 40), st.lists(st.tuples(st.booleans(), st.integers(0, 50)), max_size=60))
def test_what_is_written_is_taken(capacity: int, moves: list[tuple[bool, int]]) -> None:
    queue, given_, got, count = SampleQueue(2, capacity), [], [], 0
    for write, n in moves:
        waiting = queue.written - queue.taken
        assert 0 <= waiting <= capacity
        if write:
            samples = np.arange(count, count + n, dtype=np.float32)[:, None] * [1, -1]
            done = queue.write(samples)
            assert done == min(n, capacity - waiting)
            given_.append(samples[:done])
            count += done
        else:
            out = np.full((n, 2), np.nan, np.float32)
            done = queue.take(out)
            assert done == min(n, waiting)
            assert np.isnan(out[done:]).all()
            got.append(out[:done])
    rest = np.zeros((capacity, 2), np.float32)
    got.append(rest[: queue.take(rest)])
    np.testing.assert_array_equal(np.concatenate([np.zeros((0, 2)), *given_]), np.concatenate(got))


def test_two_threads_lose_nothing() -> None:
    queue, total = SampleQueue(1, 257), 50_000
    sent = np.arange(total, dtype=np.float32)[:, None]

    def send() -> None:
        at = 0
        while at < total:
            at += queue.write(sent[at : at + 97])
            time.sleep(0)  # else each side holds Python's lock for 5 ms in vain

    thread = threading.Thread(target=send)
    thread.start()
    got, room = [], np.zeros((61, 1), np.float32)
    while queue.taken < total:
        got.append(room[: queue.take(room)].copy())
        time.sleep(0)
    thread.join()
    np.testing.assert_array_equal(np.concatenate(got), sent)


def test_one_channel_sounds_on_all() -> None:
    queue, out = SampleQueue(2, 4), np.zeros((3, 2), np.float32)
    queue.write(np.array([[1.0], [2.0], [3.0]]))
    assert queue.take(out) == 3
    np.testing.assert_array_equal(out, [[1, 1], [2, 2], [3, 3]])
