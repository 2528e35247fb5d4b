"""Types of the driver's C interface, looked up instead of parsed.

wgpu-py names C types by text: ``ffi.new("WGPUBufferDescriptor *")``. Of each text cffi parses the first use, and makes
its parser read all 430 names of the header before it: 10 to 50 ms of each of the some sixty texts that come before a
first picture, all of it under Python's lock. A plain name, a pointer to it or an array of it needs no parser, and
neither does a callback of such.
"""

from __future__ import annotations

import re
from typing import Any

_PLAIN = re.compile(r"\s*(\w+)(\s+const)?\s*(\*|\[\s*\])?\s*")
_CALLBACK = re.compile(r"\s*void\s*\(([^()\[\]]*)\)\s*")


def look_up(ffi: Any = None) -> bool:
    """Let a cffi instance, wgpu-py's unless given, look plain types up; texts that are not plain are parsed as before.

    Whether it could: this reaches into what cffi does not promise. Without it everything is the same, and later.
    """
    try:
        from cffi import model  # type: ignore[import-untyped]
        from wgpu.backends import wgpu_native

        ffi = ffi or wgpu_native.ffi
        parser = ffi._parser
        parse, known, pointer_to = parser.parse_type, parser._declarations, parser._get_type_pointer
        primitives, array_of = model.PrimitiveType.ALL_PRIMITIVE_TYPES, model.ArrayType
    except (ImportError, AttributeError):
        return False
    if getattr(parse, "looks_up", False):
        return True

    def named(text: str) -> Any:
        """The type of a name, a pointer to it or an array of it; None where it is anything else."""
        plain = _PLAIN.fullmatch(text)
        if plain is None:
            return None
        name, constant, suffix = plain.groups()
        found = known.get(f"typedef {name}")
        if found is None and name in primitives:
            found = model.PrimitiveType(name), 0
        elif name == "void" and suffix == "*":
            found = model.void_type, 0
        if found is None or found[0].is_raw_function or (constant and suffix != "*"):
            return None
        base, qualifiers = found
        if suffix is None:
            return base
        return (
            pointer_to(base, qualifiers | (model.Q_CONST if constant else 0)) if suffix == "*" else array_of(base, None)
        )

    def parse_type(text: str) -> Any:
        found = named(text)
        if found is None and (callback := _CALLBACK.fullmatch(text)):
            parameters = [named(parameter) for parameter in callback[1].split(",")]
            if None not in parameters:
                return model.RawFunctionType(tuple(parameters), model.void_type, False)
        return parse(text) if found is None else found

    parse_type.looks_up = True  # type: ignore[attr-defined]
    parser.parse_type = parse_type
    return True
