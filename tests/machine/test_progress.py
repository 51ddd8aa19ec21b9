"""What long work does reaches whoever listens, without being passed along."""

from __future__ import annotations

from collections.abc import Callable

from sonic_bullet.machine.progress import progress_listener, progress_to, report_progress, says_so


def test_the_innermost_listener_hears_and_the_outer_one_again_afterwards() -> None:
    outer: list[str] = []
    inner: list[str] = []
    report_progress("nobody hears this")
    with progress_to(outer.append):
        report_progress("a")
        with progress_to(lambda text: inner.append(f"bar: {text}")):
            report_progress("b")
        with progress_to(None):
            report_progress("c")
    report_progress("nor this")
    assert (outer, inner) == (["a", "c"], ["bar: b"])


def test_a_callers_own_function_is_heard_below_the_door_it_was_given_to() -> None:
    @says_so(text="say")
    def work(*, say: Callable[[str], None] | None = None) -> None:
        deep()

    def deep() -> None:
        report_progress("deep")

    heard: list[str] = []
    work(say=heard.append)
    assert heard == ["deep"]


def test_a_listener_handed_on_may_be_wrapped_without_hearing_itself() -> None:
    heard: list[str] = []
    with progress_to(heard.append):
        outer = progress_listener()
        with progress_to(lambda text: outer(f"ball: {text}")):
            report_progress("solving")
    assert heard == ["ball: solving"]


def test_a_listener_is_left_when_work_fails() -> None:
    heard: list[str] = []
    try:
        with progress_to(heard.append):
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        report_progress("late")
    assert heard == []
