"""What a person sees while a command runs: results on stdout, everything else on stderr."""

from __future__ import annotations

import logging
import sys
import time
import warnings
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.console import RenderableType

_WIDE = 150
_HOLD_SECONDS = 2.0
_ESTIMATE_SECONDS = 600.0  # what the remaining time is judged by: parts may take minutes
_MOST_LINES = 9


def print_result(renderable: RenderableType | str) -> None:
    """Print a result on stdout; tables keep their columns where the output is no terminal."""
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else _WIDE, highlight=False, soft_wrap=False).print(renderable)


def say(text: str, *, every: bool = False) -> None:
    """Lines on stderr; of many, the first ones, and how many more there are, or ``every`` one."""
    lines = text.splitlines()
    if not every and len(lines) > _MOST_LINES + 1:
        lines[_MOST_LINES:] = [f"… and {len(lines) - _MOST_LINES} more"]
    for line in lines:
        print(f"tyndall: {line}", file=sys.stderr)


class Work:
    """A piece of work with a progress bar on stderr.

    The project's notes ("drawing with the software adapter …") and warnings are held back until the work has gone on
    for a while, or has ended well: where it fails at once, its error is the only line.

    Args:
        title: what is being done.
        remaining: show how long it will take, from what it took so far; for work in parts of about equal length.
    """

    def __init__(self, title: str, *, remaining: bool = False) -> None:
        self._title, self._remaining = title, remaining
        self._notes: list[str] = []
        self._begun = time.monotonic()

    def __enter__(self) -> Self:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        console = Console(stderr=True)
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
        ending = (TextColumn("left"), TimeRemainingColumn()) if self._remaining else ()
        progress = Progress(
            *columns,
            TimeElapsedColumn(),
            *ending,
            console=console,
            transient=True,
            speed_estimate_period=_ESTIMATE_SECONDS,
        )
        self._task = progress.add_task(self._title, total=1.0)
        self._progress = progress
        self._console = console
        self._handler = _Hold(self)
        self._logger = logging.getLogger("tyndall")
        self._logger.addHandler(self._handler)
        self._propagated, self._logger.propagate = self._logger.propagate, False
        self._warnings = warnings.catch_warnings()
        self._warnings.__enter__()
        warnings.simplefilter("default", UserWarning)
        warnings.showwarning = lambda message, *_, **__: self.note(str(message))
        if console.is_terminal:
            progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._progress.stop()
        self._warnings.__exit__(kind, error, trace)
        self._logger.removeHandler(self._handler)
        self._logger.propagate = self._propagated
        if error is None:
            self._release()

    def advance(self, fraction: float, stage: str) -> None:
        """Show which fraction of the whole is done, and what is being worked on."""
        if time.monotonic() - self._begun > _HOLD_SECONDS:
            self._release()
        self._progress.update(self._task, description=stage, completed=fraction)

    def note(self, line: str) -> None:
        """Tell something that is no error, in a while."""
        self._notes.append(line)

    def _release(self) -> None:
        for line in dict.fromkeys(self._notes):
            self._console.print(f"tyndall: {line}", highlight=False, markup=False, soft_wrap=True)
        self._notes.clear()


class _Hold(logging.Handler):
    """Gives a logger's records to a :class:`Work` as notes."""

    def __init__(self, work: Work) -> None:
        super().__init__(logging.INFO)
        self._work = work

    def emit(self, record: logging.LogRecord) -> None:
        self._work.note(record.getMessage())
