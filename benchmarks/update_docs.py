"""Write the tables of ``benchmarks/results/*.json`` into ``docs/benchmarks.md``, each between the marks of its name.

A result is what ``tyndall bench volumetric`` or ``tyndall compare`` saved: ``volumetric.json`` or ``results.json``.
"""

from __future__ import annotations

import json
from pathlib import Path

from tyndall.lab.bench_tables import comparison, markdown, splice

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "benchmarks.md"


def updated(page: str) -> str:
    """The page with the tables of every result."""
    for path in sorted((HERE / "results").glob("*.json")):
        document = json.loads(path.read_text(encoding="utf-8"))
        tables = markdown(document) if document.get("benchmark") == "volumetric" else comparison(document)
        page = splice(page, path.stem, tables)
    return page


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
