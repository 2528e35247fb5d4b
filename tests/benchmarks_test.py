"""The figures in the documentation are those that were measured."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RESULTS = sorted((ROOT / "benchmarks" / "results").glob("*.json"))


def test_the_page_holds_the_tables_of_every_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")  # as for a script that is run
    script = runpy.run_path(str(ROOT / "benchmarks" / "update_docs.py"))
    page = script["PAGE"].read_text(encoding="utf-8")
    assert script["updated"](page) == page, "run python benchmarks/update_docs.py"
    for path, text in script["images"]().items():
        assert path.read_text(encoding="utf-8") == text, "run python benchmarks/update_docs.py"


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_a_result_names_its_adapter_versions_and_scenes(path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    assert document["adapter"]
    assert document["driver"]
    assert document["versions"]["tyndall"]
    hashes = [document["scene_hash"]] if "scene_hash" in document else [r["scene_hash"] for r in document["scenes"]]
    assert all(len(digest) == 64 for digest in hashes)
