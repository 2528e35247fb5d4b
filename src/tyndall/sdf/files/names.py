"""Which name each kind of node has in JSON: its class's, made from the classes that there are.

A primitive is ``Primitives/NAME`` (``Profiles/NAME`` where a flat one is called like a solid), all else
``Operations/NAME``; its numbers are its declared parameters. Five kinds have a form of their own: combinations, which
are S5's ``Operations/Union``, ``Intersection`` and ``Subtraction``; transforms, materials and names, which are fields
of a node; and snippets, which are custom primitives.
"""

from __future__ import annotations

from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from tyndall.gpu.params import Field
from tyndall.sdf import grid, modifiers, profiles, repetition, solids
from tyndall.sdf.shape import Combination, Modifier, Named, Operation, Painted, Primitive, Shape, Transformed
from tyndall.sdf.snippets import Snippet

OPERATIONS: dict[str, Operation] = {
    "Union": "union",
    "Intersection": "intersection",
    "Subtraction": "subtraction",
    "SmoothUnion": "union",
    "SmoothIntersection": "intersection",
    "SmoothSubtraction": "subtraction",
}
GROUP = "Operations/Group"
_DECLARED = (grid, modifiers, profiles, repetition, solids)  # where nodes are declared, and loaded with this module
_SPECIAL = (Combination, Transformed, Painted, Named, Snippet)


def _all(cls: type[Shape]) -> list[type[Shape]]:
    found = [cls]
    for child in cls.__subclasses__():
        found += _all(child)
    return found


def _is_flat(cls: type) -> bool:
    return bool(getattr(cls, "dimension", 3) == 2)


@cache
def node_classes() -> dict[str, type[Shape]]:
    """The classes of nodes by what JSON calls them.

    Raises:
        TypeError: two have one name.
    """

    found: dict[str, type[Shape]] = {}
    classes = [
        c
        for c in dict.fromkeys(_all(Shape))
        if "__dataclass_fields__" in c.__dict__
        and c.__module__.startswith("tyndall.")
        and not c.__module__.endswith("_test")
        and not c.__name__.startswith("_")
        and c not in _SPECIAL
        and (hasattr(c, "code") or not issubclass(c, (Primitive, Modifier)))  # else it is what others share
    ]
    solid = {c.__name__ for c in classes if issubclass(c, Primitive) and not _is_flat(c)}
    for c in classes:
        group = "Primitives" if issubclass(c, Primitive) else "Operations"
        if group == "Primitives" and _is_flat(c) and c.__name__ in solid:
            group = "Profiles"
        name = f"{group}/{c.__name__}"
        if name in found or (group == "Operations" and c.__name__ in OPERATIONS):
            raise TypeError(f"{name} is two kinds of node")
        found[name] = c
    return found


@cache
def type_names() -> dict[type[Shape], str]:
    """What JSON calls each class of node."""
    return {cls: name for name, cls in node_classes().items()}


def is_data(f: Field) -> bool:
    """Whether a declared parameter of a primitive is numbers, which S5 gives as ``data``."""
    return f.type in (float, int) or (get_origin(f.type) is tuple and set(get_args(f.type)) <= {float, int})


def width(f: Field) -> int:
    """How many numbers of ``data`` a parameter is."""
    return len(get_args(f.type)) if get_origin(f.type) is tuple else 1


def mismatch(tp: Any, value: Any) -> bool:
    """Whether a JSON value is of another kind than a declared type: a text for a number, a number for a truth."""
    origin, args = get_origin(tp), get_args(tp)
    if origin in (Union, UnionType):
        return all(mismatch(a, value) for a in args)
    if origin is Literal:
        return False
    if origin is tuple:
        if not isinstance(value, list):
            return True
        return len(args) == len(value) and any(mismatch(a, v) for a, v in zip(args, value, strict=True))
    if tp in (int, float):
        return isinstance(value, bool) or not isinstance(value, (int, float))
    if tp is bool:
        return not isinstance(value, bool)
    if tp is str:
        return not isinstance(value, str)
    return tp is type(None) and value is not None
