"""Words of the command line as values.

Every parameter of every technique is a flag by its own name, ``--froxel.grid 190,90,128``. These flags are not typed
here: they come from the techniques' declarations, so a new technique has its flags, checks and errors at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tyndall.gpu.params import ParameterError, convert, fields_of, nearest

Overrides = dict[str, dict[str, Any]]
"""Parameter values by technique name, then by parameter name."""

_FLAG = re.compile(r"--([\w-]+)\.([\w.-]*)(?:=(.*))?", re.DOTALL)
_SIZE = re.compile(r"([+-]?\d{1,9})\s*[x×X*]\s*([+-]?\d{1,9})")


def split_flags(words: Sequence[str]) -> tuple[list[str], list[tuple[str, str, str]]]:
    """Separate ``--technique.parameter value`` (or ``=value``) from the other words.

    Returns:
        The other words in order, and (technique, parameter, text) per flag.

    Raises:
        ParameterError: a flag without its value.
    """
    rest: list[str] = []
    flags: list[tuple[str, str, str]] = []
    remaining = iter(words)
    for word in remaining:
        match = _FLAG.fullmatch(word)
        if match is None:
            rest.append(word)
            continue
        technique, parameter, text = match.groups()
        if text is None:
            text = next(remaining, None)
        if text is None or text.startswith("--"):
            raise ParameterError(f"--{technique}.{parameter}: needs a value")
        flags.append((technique.replace("-", "_"), parameter.replace("-", "_"), text))
    return rest, flags


def convert_flags(flags: Iterable[tuple[str, str, str]], members: Mapping[str, type]) -> Overrides:
    """The values of ``--technique.parameter`` flags, checked against the declarations of ``members``.

    Raises:
        ParameterError: an unknown technique or parameter, with the nearest right one, or a value that is not allowed.
    """
    overrides: Overrides = {}
    for technique, parameter, text in flags:
        flag = f"--{technique}.{parameter}"
        if technique not in members:
            raise ParameterError(f"{flag}: no technique '{technique}'{nearest(technique, members)}")
        declared = {f.name: f for f in fields_of(members[technique])}
        if parameter not in declared:
            hint = nearest(parameter, declared) or (f"; it has {', '.join(declared)}" if declared else "; it has none")
            raise ParameterError(f"{flag}: '{technique}' has no parameter '{parameter}'{hint}")
        try:
            value = convert(declared[parameter], text)
        except ParameterError as error:
            raise ParameterError(f"--{technique}.{error}") from error
        overrides.setdefault(technique, {})[parameter] = value
    return overrides


def parse_size(text: str) -> tuple[int, int]:
    """``640x360`` as (width, height).

    Raises:
        ParameterError: not two whole numbers, or no pixel in the picture.
    """
    match = _SIZE.fullmatch(text.strip())
    if match is None:
        raise ParameterError(f"--size: '{text}' is not WIDTHxHEIGHT, like 1280x720")
    width, height = int(match[1]), int(match[2])
    if width < 1 or height < 1:
        raise ParameterError(f"--size: a picture of {width}×{height} has no pixels")
    return width, height


def split_list(texts: Iterable[str]) -> list[str]:
    """The names in ``off,froxel`` or in repeated options, each once and in order; hyphens stand for underscores."""
    names = (name.strip().replace("-", "_") for text in texts for name in text.split(","))
    return list(dict.fromkeys(name for name in names if name))
