"""The report: one HTML file that needs nothing but a browser.

:func:`write_report` reads what :meth:`tyndall.lab.compare.Comparison.save` wrote and writes ``report.html`` beside it:
the verdict in a sentence, a divider between any two pictures whose light can be exposed anew, maps of the error on one
colour scale, close-ups, cost against error with the Pareto front, passes, memory, every figure, and how to make it all
again. Everything is inside the file, and a content security policy forbids it to ask for more.

The page's text, tables and pictures are made here and are there without JavaScript; the scripts beside this module add
what moves. They know no library.
"""

from __future__ import annotations

import os
from pathlib import Path

from tyndall.lab.picture import OutputError, write_atomically
from tyndall.lab.report import sweep
from tyndall.lab.report.images import MOST_BYTES, images
from tyndall.lab.report.page import ANCHORS, comparison, overview, page
from tyndall.lab.report.results import FILE, read

NAME = "report.html"


def write_report(folder: str | os.PathLike[str]) -> Path:
    """Write the report of a saved comparison, of a sweep, or of a folder whose sub-folders are saved comparisons.

    Returns:
        The path of the HTML file, ``folder/report.html``.

    Raises:
        OutputError: one line; there is no ``results.json``, it is broken, a picture is missing, or the file cannot be
            written.
    """
    target = Path(folder)
    text = _of_sweep(target) if _is_sweep(target) else _of_comparisons(target)
    path = target / NAME

    def write(place: Path) -> None:
        place.write_bytes(text.encode("utf-8", errors="replace"))  # a name from a file may hold half a character

    write_atomically(path, write)
    return path


def _is_sweep(folder: Path) -> bool:
    return (folder / sweep.FILE).exists() and not (folder / FILE).exists()


def _of_sweep(folder: Path) -> str:
    name = folder.resolve().name
    article = sweep.sweep(*sweep.read_rows(folder), name)
    return page(f"{name} – Tyndall", [(name, article)], {"s-plot0": "Plots", "s-table": "Points"})


def _of_comparisons(target: Path) -> str:
    folders = [target]
    if target.is_dir() and not (target / FILE).exists():
        folders = sorted(path.parent for path in target.glob(f"*/{FILE}")) or folders
    studies = [read(path) for path in folders]
    several = len(studies) > 1
    names = [study.scene for study in studies]
    parts = []
    for number, study in enumerate(studies):
        name = study.scene if names.count(study.scene) == 1 else f"{study.scene} ({study.folder.name})"
        drawn = images(study, MOST_BYTES // len(studies))
        parts.append((name, comparison(study, drawn, number, "h2" if several else "h1")))
    title = f"{len(studies)} comparisons" if several else studies[0].scene
    return page(f"{title} – Tyndall", parts, ANCHORS, overview(studies) if several else None)


__all__ = ["NAME", "OutputError", "write_report"]
