"""Typed access to a JSON document that somebody else wrote, where every mistake knows its path inside the file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Never

from tyndall.scene.errors import SceneError
from tyndall.scene.files.source import shorten


@dataclass(frozen=True)
class Cursor:
    """A place in a JSON document.

    Attributes:
        file: the file, for messages. where: the path inside it, ``nodes[3].mesh``. value: what is there.
    """

    file: Path
    where: str
    value: Any

    @classmethod
    def parse(cls, file: Path, text: bytes) -> Cursor:
        """The root object of a JSON text.

        Raises:
            SceneError: not UTF-8, not JSON, nested too deeply, or not an object.
        """
        try:
            value = json.loads(text.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            raise SceneError(file, f"not UTF-8 text (byte {error.start})") from error
        except json.JSONDecodeError as error:
            raise SceneError(file, f"not JSON: {error.msg} at line {error.lineno} column {error.colno}") from error
        except RecursionError as error:
            raise SceneError(file, "not JSON that can be read: nested too deeply") from error
        except ValueError as error:
            raise SceneError(file, f"not JSON: {shorten(str(error))}") from error
        return cls(file, "", value)._object()

    def stop(self, message: str) -> Never:
        """Raise a SceneError that names this place."""
        raise SceneError(self.file, f"{self.where}: {message}" if self.where else message)

    def _object(self) -> Cursor:
        if not isinstance(self.value, dict):
            self.stop("is not an object")
        return self

    def _step(self, key: str) -> str:
        return f"{self.where}.{shorten(key)}" if self.where else shorten(key)

    def get(self, key: str) -> Cursor | None:
        """The member ``key`` of an object; None where there is none."""
        value = self._object().value.get(key)
        return None if value is None else Cursor(self.file, self._step(key), value)

    def need(self, key: str) -> Cursor:
        """The member ``key`` of an object."""
        return self.get(key) or self.stop(f"has no '{key}'")

    def object(self, *keys: str) -> Cursor:
        """The object that a chain of keys leads to; an empty one where the chain ends early."""
        here = self
        for key in keys:
            here = here.get(key) or Cursor(self.file, here._step(key), {})
        return here._object()

    def items(self, key: str) -> list[Cursor]:
        """The items of the list ``key``; none where there is no such list."""
        found = self.get(key)
        if found is None:
            return []
        if not isinstance(found.value, list):
            found.stop("is not a list")
        return [Cursor(self.file, f"{found.where}[{i}]", value) for i, value in enumerate(found.value)]

    def members(self) -> Iterator[tuple[str, Cursor]]:
        """The members of an object."""
        for key, value in self._object().value.items():
            yield key, Cursor(self.file, self._step(key), value)

    def text(self, key: str, default: str = "") -> str:
        """The text ``key``."""
        found = self.get(key)
        if found is None:
            return default
        if not isinstance(found.value, str):
            found.stop("is not a text")
        return str(found.value)

    def flag(self, key: str) -> bool:
        """The truth value ``key``; false where there is none."""
        found = self.get(key)
        if found is not None and not isinstance(found.value, bool):
            found.stop("is not true or false")
        return found is not None and bool(found.value)

    def as_int(self, low: int = 0, high: int | None = None) -> int:
        """This value as a whole number in ``low`` … ``high``."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value // 1:
            self.stop(f"{shorten(repr(value))} is not a whole number")
        if value < low or (high is not None and value > high):
            self.stop(f"{shorten(repr(value))} is outside {low} …" + (f" {high}" if high is not None else ""))
        return int(value)

    def integer(self, key: str, default: int, low: int = 0, high: int | None = None) -> int:
        """The whole number ``key``."""
        found = self.get(key)
        return default if found is None else found.as_int(low, high)

    def as_number(self) -> float:
        """This value as a finite number."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.stop(f"{shorten(repr(value))} is not a number")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.stop(f"{number} is not a finite number")
        return number

    def number(self, key: str, default: float) -> float:
        """The number ``key``."""
        found = self.get(key)
        return default if found is None else found.as_number()

    def numbers(self, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """As many numbers as ``default`` has."""
        if self.get(key) is None:
            return default
        items = self.items(key)
        if len(items) != len(default):
            Cursor(self.file, self._step(key), None).stop(f"has {len(items)} items, not {len(default)}")
        return tuple(item.as_number() for item in items)

    def as_index(self, table: list[Any], what: str) -> int:
        """This value as an index into ``table``, whose items are ``what``."""
        index = self.as_int()
        if index >= len(table):
            self.stop(f"{index} is beyond the last of {len(table)} {what}")
        return index
