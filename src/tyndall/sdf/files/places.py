"""JSON with the places of its texts, so that a mistake inside of a shader can be told by the line of the file."""

from __future__ import annotations

import json
import re
from typing import Any

_TOKEN = re.compile(r'\s*(?:(?P<string>"(?:[^"\\]|\\.)*")|(?P<sign>[{}\[\],:])|(?P<other>[^\s{}\[\],:"]+))', re.DOTALL)
Path = tuple[str | int, ...]


class _RefusedError(ValueError):
    pass


def parse(text: str) -> Any:
    """The value of a JSON text. Texts may have line ends in them, as S5 writes code.

    Raises:
        ValueError: not JSON, a key twice in one object, a number that is not finite, or nested too deeply.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            raise _RefusedError(f"'{next(k for k in keys if keys.count(k) > 1)}' is twice in one object")
        return found

    def refuse(name: str) -> Any:
        raise _RefusedError(f"{name} is not a finite number")

    try:
        return json.loads(text, strict=False, object_pairs_hook=once, parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise ValueError(f"{error.msg} at line {error.lineno} column {error.colno}") from None
    except RecursionError:
        raise ValueError("nested too deeply") from None


def places(text: str) -> dict[Path, int]:
    """The offset of the first character of each text that is a value of a right JSON text, by its path."""
    found: dict[Path, int] = {}
    path: list[str | int] = []
    is_object: list[bool] = []
    key = True  # a text is a key here
    at = 0
    while match := _TOKEN.match(text, at):
        at = match.end()
        if token := match["string"]:
            if is_object and is_object[-1] and key:
                path[-1] = json.loads(token, strict=False)
            else:
                found[tuple(path)] = match.start("string") + 1
            continue
        match match["sign"]:
            case "{":
                is_object.append(True)
                path.append("")
                key = True
            case "[":
                is_object.append(False)
                path.append(0)
            case "}" | "]":
                is_object.pop()
                path.pop()
            case ":":
                key = False
            case ",":
                if is_object[-1]:
                    key = True
                else:
                    path[-1] = int(path[-1]) + 1
    return found
