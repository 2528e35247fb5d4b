"""What can be wrong with a scene file, in words for the person who has the file."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike


class SceneError(ValueError):
    """A file that is not a scene. The message has one line for each mistake, and each line names the file.

    Attributes:
        mistakes: the lines without the file's name, ``lights[2].intensity: -1 is outside ≥ 0``.
    """

    def __init__(self, path: str | PathLike[str], mistakes: str | Iterable[str]) -> None:
        self.mistakes = (mistakes,) if isinstance(mistakes, str) else tuple(mistakes)
        super().__init__("\n".join(f"{path}: {mistake}" for mistake in self.mistakes))


class SceneWarning(UserWarning):
    """Something in a scene file that Tyndall leaves out; the rest is loaded."""
