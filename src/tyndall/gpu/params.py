"""One declaration for a parameter.

A technique, a light, a medium is a frozen dataclass whose fields are declared with :func:`param`: default, range,
meaning and unit in one line. From that line alone come validation, the WESL uniform struct and its bytes
(:func:`struct_wesl`, :func:`pack`), the CLI flags, the JSON schema and the reference docs.

>>> @dataclass(frozen=True)
... class Fog:
...     steps: int = param(64, 1, 4096, "samples along a ray")
...     jitter: float = param(0.5, 0, 1, "offset of a sample inside its step", unit="step")
...     def __post_init__(self) -> None:
...         check(self)
>>> Fog(steps=0)
Traceback (most recent call last):
    ...
tyndall.gpu.params.ParameterError: steps: 0 is outside 1 … 4096
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

_KEY = "tyndall.param"
_LARGEST = 1e30  # a float32 holds it, and its product with another of a device's numbers of usual size


def _cached[F: Callable[..., Any]](function: F) -> F:
    """:func:`functools.cache` that keeps the function's signature: mypy does not take a class for hashable."""
    return cast(F, cache(function))


class ParameterError(ValueError):
    """A value that a declaration does not allow. The message is one line and names the field."""


@dataclass(frozen=True)
class Param:
    """What :func:`param` declared about one field.

    Attributes:
        low, high: inclusive range of the value, or of every component of a tuple; None where unbounded.
        doc: the meaning, a phrase without a full stop.
        unit: SI symbol or the field's own unit ("froxel"); empty for a plain number.
        rebuild: the value sizes a resource or a pipeline; changing it is not a uniform write.
    """

    low: float | None
    high: float | None
    doc: str
    unit: str
    rebuild: bool


def param(
    default: Any,
    low: float | None = None,
    high: float | None = None,
    doc: str = "",
    *,
    unit: str = "",
    rebuild: bool = False,
) -> Any:
    """Declare a dataclass field. ``low`` and ``high`` are inclusive and hold for every component of a tuple.

    ``default`` may be ``...`` for a field that the caller must give.
    """
    metadata = {_KEY: Param(low, high, doc, unit, rebuild)}
    if default is ...:
        return field(metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Field:
    """A declared field: its name, resolved type, default (``MISSING`` if required) and :class:`Param`."""

    name: str
    type: Any
    default: Any
    param: Param


@_cached
def fields_of(cls: type) -> tuple[Field, ...]:
    """The fields of ``cls`` that were declared with :func:`param`, in order."""
    hints = get_type_hints(cls)
    return tuple(
        Field(f.name, hints[f.name], f.default, f.metadata[_KEY]) for f in dataclasses.fields(cls) if _KEY in f.metadata
    )


def nearest(name: str, known: Iterable[str]) -> str:
    """A trailing phrase that offers the nearest known name: `` — did you mean 'froxel'?``; empty when none is near."""
    match = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f" — did you mean '{match[0]}'?" if match else ""


def check(instance: Any) -> None:
    """Validate every declared field of a dataclass instance, for use in ``__post_init__``.

    Numbers are converted to the declared type in place (an int given for a float, a list or array for a tuple).

    Raises:
        ParameterError: naming the field, the value and what is allowed.
    """
    for f in fields_of(type(instance)):
        value = convert(f, getattr(instance, f.name))
        object.__setattr__(instance, f.name, value)


def convert(f: Field, value: Any) -> Any:
    """``value`` as the type that ``f`` declares, inside its range.

    Raises:
        ParameterError: it cannot be converted, is not finite or beyond ±1e30, or is outside the range.
    """
    try:
        result = _as_type(f.type, value)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{f.name}: {value!r} is not {describe_type(f.type)}{_hint(f.type, value)}") from error
    for component in _numbers(result):
        if not math.isfinite(component):
            raise ParameterError(f"{f.name}: {component} is not a finite number")
        if abs(component) > _LARGEST:
            raise ParameterError(f"{f.name}: {component:g} is beyond {_LARGEST:g}")
        if (f.param.low is not None and component < f.param.low) or (
            f.param.high is not None and component > f.param.high
        ):
            raise ParameterError(f"{f.name}: {_digits(component)} is outside {describe_range(f.param)}")
    return result


def describe_range(p: Param) -> str:
    """``1 … 4096``, ``≥ 0``, ``≤ 1`` or ``any``."""
    if p.low is None:
        return "any" if p.high is None else f"≤ {_digits(p.high)}"
    if p.high is None:
        return f"≥ {_digits(p.low)}"
    return f"{_digits(p.low)} … {_digits(p.high)}"


def _digits(number: float) -> str:
    """A whole number with all of its digits, or 10,000,001 would be outside 10 … 1e+07; others with six."""
    return f"{number:.12g}" if number == int(number) else f"{number:g}"


def describe_type(tp: Any) -> str:
    """A reader's name of a type: ``3 whole numbers``, ``one of 'paper', 'physical'``."""
    origin = get_origin(tp)
    if origin is Literal:
        return "one of " + ", ".join(repr(a) for a in get_args(tp))
    if origin is tuple:
        args = get_args(tp)
        return f"{len(args)} {'whole numbers' if args[0] is int else 'numbers'}"
    if origin in (Union, UnionType):
        return " or ".join(describe_type(a) for a in get_args(tp))
    names = {int: "a whole number", float: "a number", bool: "true or false", str: "a text", NoneType: "nothing"}
    return names.get(tp, getattr(tp, "__name__", str(tp)))


def _hint(tp: Any, value: Any) -> str:
    if get_origin(tp) is Literal and isinstance(value, str):
        return nearest(value, [a for a in get_args(tp) if isinstance(a, str)])
    return ""


def _as_type(tp: Any, value: Any) -> Any:
    origin = get_origin(tp)
    if origin in (Union, UnionType):
        errors: list[Exception] = []
        for option in get_args(tp):
            try:
                return _as_type(option, value)
            except (TypeError, ValueError) as error:
                errors.append(error)
        raise errors[0]
    if origin is Literal:
        for choice in get_args(tp):
            if str(choice) == str(value):
                return choice
        raise ValueError(value)
    if origin is tuple:
        args = get_args(tp)
        items = value.split("," if "," in value else "x") if isinstance(value, str) else list(value)
        if len(items) != len(args):
            raise ValueError(value)
        return tuple(_as_type(a, item) for a, item in zip(args, items, strict=True))
    if tp is bool:
        if isinstance(value, str) and value.lower() in ("true", "false"):
            return value.lower() == "true"
        if not isinstance(value, (bool, np.bool_)):
            raise TypeError(value)
        return bool(value)
    if tp is int:
        number = float(value)
        if isinstance(value, (bool, np.bool_)) or not number.is_integer():
            raise ValueError(value)
        return int(number)
    if tp is float:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError(value)
        return float(value)
    if tp is NoneType:
        if value is not None and value != "none":
            raise TypeError(value)
        return None
    if not isinstance(value, tp):
        raise TypeError(value)
    return value


def _numbers(value: Any) -> Iterable[float]:
    if isinstance(value, bool):
        return
    if isinstance(value, (int, float)):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)


def replace[T](instance: T, changes: Mapping[str, Any]) -> T:
    """A copy of a dataclass with some fields changed; values may be texts, as a command line gives them.

    Raises:
        ParameterError: an unknown field (the nearest right one is named) or a value that is not allowed.
    """
    known = {f.name: f for f in fields_of(type(instance))}
    for name in changes:
        if name not in known:
            raise ParameterError(f"{name}: no such parameter{nearest(name, known)}")
    converted = {name: convert(known[name], value) for name, value in changes.items()}
    return dataclasses.replace(instance, **converted)  # type: ignore[type-var]


# --- the uniform of a parameter set -------------------------------------------------------------------------------

_SCALARS = {float: ("f32", "<f4"), int: ("i32", "<i4"), bool: ("u32", "<u4")}


def _wgsl_type(tp: Any) -> tuple[str, str, int, int] | None:
    """WGSL name, numpy scalar, component count and alignment in bytes; None for a type that stays on the host."""
    if tp in _SCALARS:
        name, scalar = _SCALARS[tp]
        return name, scalar, 1, 4
    if get_origin(tp) is tuple:
        args = get_args(tp)
        if args and args[0] in _SCALARS and 2 <= len(args) <= 4:
            name, scalar = _SCALARS[args[0]]
            return f"vec{len(args)}<{name}>", scalar, len(args), 8 if len(args) == 2 else 16
    if get_origin(tp) is Literal and all(isinstance(a, str) for a in get_args(tp)):
        return "u32", "<u4", 1, 4
    return None


@_cached
def uniform_dtype(cls: type) -> np.dtype[Any]:
    """The numpy layout of ``cls`` in a WGSL uniform buffer (WGSL spec, 14.4.1); a text choice is its index."""
    names, formats, offsets, end = [], [], [], 0
    for f in fields_of(cls):
        wgsl = _wgsl_type(f.type)
        if wgsl is None:
            continue
        _, scalar, count, align = wgsl
        offset = -(-end // align) * align
        names.append(f.name)
        formats.append(scalar if count == 1 else f"{count}{scalar}")
        offsets.append(offset)
        end = offset + 4 * count
    size = max(16, -(-end // 16) * 16)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


@_cached
def struct_wesl(cls: type, name: str) -> str:
    """The WESL struct of ``cls``, with a constant ``CLASS_FIELD_CHOICE`` for every text choice."""
    members, constants = [], []
    for f in fields_of(cls):
        wgsl = _wgsl_type(f.type)
        if wgsl is None:
            continue
        members.append(f"    {f.name}: {wgsl[0]},")
        if get_origin(f.type) is Literal:
            constants += [
                f"const {cls.__name__.upper()}_{f.name.upper()}_{choice.upper()} = {i}u;"
                for i, choice in enumerate(get_args(f.type))
            ]
    if not members:
        members = ["    unused_: u32,"]
    return "\n".join([*constants, f"struct {name} {{", *members, "}", ""])


def pack(instance: Any) -> np.ndarray[Any, np.dtype[Any]]:
    """The uniform bytes of a parameter set, as a 0-d structured array of :func:`uniform_dtype`."""
    out = np.zeros((), uniform_dtype(type(instance)))
    types = {f.name: f.type for f in fields_of(type(instance))}
    for name in out.dtype.names or ():
        value = getattr(instance, name)
        out[name] = get_args(types[name]).index(value) if get_origin(types[name]) is Literal else value
    return out
