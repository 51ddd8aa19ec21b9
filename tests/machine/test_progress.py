"""What long work does reaches whoever listens, without being passed along."""

from __future__ import annotations

from collections.abc import Callable

from sonic_bullet.machine.progress import (
    progress_listener,
    progress_part,
    progress_to,
    progress_under,
    report_fraction,
    report_progress,
    show_progress,
    without_progress,
)


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
    def work(*, say: Callable[[str], None] | None = None) -> None:
        with show_progress(say):
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
        with progress_to(lambda text: outer(f"ball: {text}")), progress_under("modes"):
            report_progress("solving")
    assert heard == ["ball: modes: solving"]


def test_a_part_of_the_work_reports_its_part_of_the_whole() -> None:
    heard: list[float] = []
    with progress_to(fraction=heard.append):
        with progress_part(0.5, 0.75):
            report_fraction(0.0)
            with progress_part(0.0, 0.5):
                report_fraction(1.0)
        with without_progress():
            report_fraction(0.9)
        report_fraction(1.0)
    with progress_part(0.5, 1.0):
        report_fraction(0.25)  # nobody listens
    assert heard == [0.5, 0.625, 1.0]


def test_a_door_that_is_given_one_function_tells_nobody_else() -> None:
    texts: list[str] = []
    fractions: list[float] = []
    with progress_to(texts.append, fractions.append):
        with show_progress(fraction=lambda _: None):
            report_progress("a"), report_fraction(0.1)
        with show_progress(in_percent=True):
            report_progress("b"), report_fraction(0.2)
    assert (texts, fractions) == (["b"], [0.2])


def test_a_listener_is_left_when_work_fails() -> None:
    heard: list[str] = []
    try:
        with progress_to(heard.append):
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        report_progress("late")
    assert heard == []
