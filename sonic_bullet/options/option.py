"""What an option is, and how a record of options becomes the keywords of a function.

    @dataclass(frozen=True, kw_only=True, slots=True)
    class LevelOptions(Options):
        lufs: float | None = option(None, "Scale to this programme loudness (say -23).", metavar="L")

A field without `option` is of Python alone. A field whose default is `group(Record)` holds that record's options: on a
command line they stand among the others, under its heading.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from functools import wraps
from types import NoneType, UnionType
from typing import Any, ClassVar, Concatenate, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, overload

from sonic_bullet.records.errors import RecordError, SonicBulletError

Value = TypeVar("Value")
Subject = TypeVar("Subject")
Other = TypeVar("Other")
Third = TypeVar("Third")
Record = TypeVar("Record", bound="Options")
Result = TypeVar("Result")
Keywords = ParamSpec("Keywords")


@dataclass(frozen=True, slots=True)
class Option:
    """What a user should know of an option, beside its type and its default.

    Parameters
    ----------
    help
        What it does, with its unit.
    flags
        Its names on a command line; none: that of the field.
    metavar
        What stands for its value in help, such as ``X,Y,Z``.
    least, above, most
        Bounds of a number; ``above`` itself is out.
    unset
        In words, what holds where it is not given; "": its default.
    read
        Makes a value of the text on a command line; ValueError says what the text should be.
    words
        Type of what stands on a command line, where that is not the field's own.
    choices
        The texts that it may be; none: any.
    bare
        Text that stands for the value where the flag is given alone.
    """

    help: str
    flags: tuple[str, ...] = ()
    metavar: str | None = None
    least: float | None = None
    above: float | None = None
    most: float | None = None
    unset: str = ""
    read: Callable[[str], Any] | None = None
    words: Any = None
    choices: tuple[str, ...] = ()
    bare: str | None = None

    def holds(self, number: float) -> bool:
        """Tell whether a number is within the bounds."""
        return (
            abs(number) < 2**63  # no whole number of more bits, and neither inf nor NaN
            and (self.above is None or number > self.above)
            and (self.least is None or number >= self.least)
            and (self.most is None or number <= self.most)
        )

    @property
    def bounds(self) -> str:
        """The bounds in words, "" for none."""
        said = [(self.above, "above"), (self.least, "from"), (self.most, "to" if self.least is not None else "at most")]
        return " ".join(f"{word} {bound:g}" for bound, word in said if bound is not None)


def option(default: Value, help: str, *flags: str, **about: Any) -> Value:
    """Make a field of a record: its default, and what `Option` says of it."""
    made: Any = field(default=default, metadata={"option": Option(help, flags, **about)})
    return made  # type: ignore[no-any-return]  # a field stands where its default's type is declared


def require_option(help: str, *flags: str, **about: Any) -> Mapping[str, Option]:
    """Return the metadata of a field that must be given: ``count: int = field(metadata=required("How many."))``."""
    return {"option": Option(help, flags, **about)}


def group(record: type[Record]) -> Record:
    """Make a field that holds another record's options."""
    made: Any = field(default_factory=record)
    return made  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Base of all records of options: numbers and flags are checked when one is built.

    error: what is raised where one is wrong.
    """

    error: ClassVar[type[SonicBulletError]] = RecordError

    def __post_init__(self) -> None:
        """Raise ``error`` where a number is out of bounds, or a flag is neither True nor False."""
        for one in fields(self):
            about, value = option_of(one), getattr(self, one.name)
            if about is None or (value is None and (one.default is None or about.unset)):
                continue
            kind = own_type(type(self), one.name) if about.words is None else None
            if kind is bool and not isinstance(value, bool):
                from sonic_bullet.records.coerce import as_flag

                object.__setattr__(self, one.name, as_flag(value, one.name))
            elif kind in (int, float) and about.bounds and not (type(value) is kind and about.holds(value)):
                object.__setattr__(self, one.name, _as_number(kind, value, one.name, about, self.error))


def _as_number(kind: type, value: object, name: str, about: Option, error: type[SonicBulletError]) -> float:
    from sonic_bullet.records.coerce import as_number, as_whole, quote

    remedy = " ".join(filter(None, (f"give a {'whole ' * (kind is int)}number", about.bounds)))
    number = (as_whole if kind is int else as_number)(value, name, remedy, error=error)
    if not about.holds(number):
        raise error(f"{name} is {quote(value)}", remedy)
    return number


def option_of(one: Field[Any]) -> Option | None:
    """Return what is said of a field; None of one that is of Python alone."""
    found: Option | None = one.metadata.get("option")
    return found


def own_type(record: type[Options], name: str) -> Any:
    """Return the type of a field, None left out of it; None where only a type checker knows it."""
    for owner in record.__mro__:
        if name in vars(owner).get("__annotations__", {}):
            written, names = owner.__annotations__[name], vars(sys.modules[owner.__module__])
            break
    try:
        kind = eval(written, dict(names)) if isinstance(written, str) else written
    except NameError:
        return None
    if get_origin(kind) in (UnionType, Union):
        kinds = [one for one in get_args(kind) if one is not NoneType]
        return kinds[0] if len(kinds) == 1 else None
    return kind


def flag_of(one: Field[Any]) -> str:
    """Return the name of an option on a command line, the longest where it has two."""
    about = option_of(one)
    return about.flags[-1] if about is not None and about.flags else f"--{one.name.replace('_', '-')}"


def given_flags(options: Options) -> list[str]:
    """Return the flags of the options that are not at their default."""
    return [flag_of(one) for one in fields(options) if option_of(one) and getattr(options, one.name) != one.default]


def keywords(options: Options) -> dict[str, Any]:
    """Return the options as keywords of the function that takes them."""
    return {one.name: getattr(options, one.name) for one in fields(options)}


@overload
def takes(
    record: Callable[Keywords, Record],
) -> Callable[[Callable[[Subject, Record], Result]], Callable[Concatenate[Subject, Keywords], Result]]: ...


@overload
def takes(
    record: Callable[Keywords, Record], subjects: Literal[2]
) -> Callable[
    [Callable[[Subject, Other, Record], Result]], Callable[Concatenate[Subject, Other, Keywords], Result]
]: ...


@overload
def takes(
    record: Callable[Keywords, Record], subjects: Literal[3]
) -> Callable[
    [Callable[[Subject, Other, Third, Record], Result]], Callable[Concatenate[Subject, Other, Third, Keywords], Result]
]: ...


def takes(record: Any, subjects: int = 1) -> Any:
    """Make a function of some subjects and a record one of these subjects and the record's fields as keywords.

    Its docstring goes on with the options, as their record says them.
    """
    names = {one.name for one in fields(record)}

    def decorated(function: Callable[..., Result]) -> Callable[..., Result]:
        @wraps(function)
        def called(*args: Any, **given: Any) -> Result:
            own = {name: given.pop(name) for name in [*given] if name in names}
            return function(*args, **given, **{last: record(**own)})

        whole = inspect.signature(function)
        *first, last = whole.parameters
        asked = [whole.parameters[name] for name in first] + [*inspect.signature(record).parameters.values()]
        called.__signature__ = whole.replace(parameters=asked)  # type: ignore[attr-defined]
        called.__doc__ = f"{inspect.cleandoc(function.__doc__ or '')}\n\n{describe_options(record)}"
        return called

    return decorated


def describe_options(record: type[Options]) -> str:
    """Describe the options of a record as a numpydoc section."""
    lines = ["Other Parameters", "----------------"]
    for one in fields(record):
        about = option_of(one)
        if about is not None:
            bounds = f" Bounds: {about.bounds}." if about.bounds else ""
            unset = f" None: {about.unset}." if about.unset else ""
            lines += [one.name, f"    {about.help}{bounds}{unset}"]
    return "\n".join(lines)
