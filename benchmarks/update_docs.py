"""Write the tables of ``benchmarks/results/*.json`` into ``docs/benchmarks.md``, each between the marks of its name,
and the plots of S1's figures into ``docs/images``.

A result is what ``tyndall bench volumetric`` or ``tyndall compare`` saved, ``volumetric.json`` or ``results.json``, or
what ``benchmarks/rays.py``, ``benchmarks/truth.py``, ``benchmarks/shadows.py`` or ``benchmarks/sdf.py`` printed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import ray_tables

from tyndall.lab import bench_sdf_tables, bench_shadows_tables
from tyndall.lab.bench_tables import comparison, markdown, plots, splice

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "benchmarks.md"
IMAGES = PAGE.parent / "images"


def results() -> dict[str, Any]:
    """Every result by its name."""
    paths = sorted((HERE / "results").glob("*.json"))
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in paths}


def is_bench(document: Any) -> bool:
    """Whether a result is one of the benchmark, not of a comparison."""
    return bool(document.get("benchmark") == "volumetric")


def updated(page: str) -> str:
    """The page with the tables of every result."""
    for name, document in results().items():
        page = splice(page, name, tables(name, document))
    return page


def tables(name: str, document: Any) -> str:
    """A result as Markdown."""
    match document.get("benchmark"):
        case "volumetric":
            return markdown(document, f"images/{name}-")
        case "shadows":
            return bench_shadows_tables.markdown(document)
        case "sdf":
            return bench_sdf_tables.markdown(document)
        case "rays":
            return ray_tables.rays(document)
        case "truth":
            return ray_tables.truth(document)
    return comparison(document)


def images() -> dict[Path, str]:
    """The plots of every result, by their files."""
    return {
        IMAGES / f"{name}-{plot}.svg": text
        for name, document in results().items()
        if is_bench(document)
        for plot, text in plots(document).items()
    }


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    for path, text in images().items():
        path.write_text(text, encoding="utf-8")
