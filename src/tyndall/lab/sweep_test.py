"""A sweep may be stopped at any moment, its workers may die, its disk may be full: nothing is lost or done twice."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
import sweep_work

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.lab import standard, sweep_store
from tyndall.lab.mitsuba import Availability, MitsubaError, Variant
from tyndall.lab.picture import OutputError
from tyndall.lab.sweep import sweep
from tyndall.lab.sweep_store import Store, columns_of, flat
from tyndall.lab.truth import Truth, trace
from tyndall.scene.files import save
from tyndall.scene.model import PointLight, Scene

ROOT = Path(__file__).parents[3]


def spec(heights: Sequence[int]) -> dict[str, Any]:
    """Points that differ in their height."""
    return {"scenes": "box", "techniques": "off", "sizes": [[8, height] for height in heights]}


def heights(rows: Sequence[Any], status: str = "done") -> list[int]:
    return [row["point"]["size"][1] for row in rows if row["status"] == status]


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the work of tests notes down what it measures."""
    path = tmp_path / "log"
    path.write_text("")
    monkeypatch.setenv("SWEEP_LOG", str(path))
    return path


def measured(log: Path) -> Counter[int]:
    """How often each height was measured."""
    return Counter(map(int, log.read_text().split()))


# --- rows -----------------------------------------------------------------------------------------------------------


def test_what_is_done_is_not_repeated_and_what_is_new_is_added(tmp_path: Path, log: Path) -> None:
    first = sweep(spec([1, 2, 3]), tmp_path / "out", workers=0, work=sweep_work.quick)
    assert (heights(first.rows), first.reused) == ([1, 2, 3], 0)
    second = sweep(spec([5, 3, 2]), tmp_path / "out", workers=0, work=sweep_work.quick)
    assert (heights(second.rows), second.reused) == ([5, 3, 2], 2)
    assert measured(log) == {1: 1, 2: 1, 3: 1, 5: 1}
    assert second.notes[0].startswith("2 of 3 points were measured before")
    assert second.notes[1].startswith("1 rows in results.jsonl are not of this specification")
    assert len((tmp_path / "out/results.jsonl").read_text().splitlines()) == 4
    assert json.loads((tmp_path / "out/spec.json").read_text()) == spec([5, 3, 2])
    assert json.loads((tmp_path / "out/points.json").read_text()) == [row["id"] for row in second.rows]
    again = sweep(spec([3]), tmp_path / "out", workers=0, fresh=True, work=sweep_work.quick)
    assert (measured(log)[3], again.reused) == (2, 0)


def test_a_line_that_was_cut_off_is_measured_again(tmp_path: Path, log: Path) -> None:
    sweep(spec([1, 2, 3]), tmp_path, workers=0, work=sweep_work.quick)
    path = tmp_path / "results.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    assert heights(sweep(spec([1, 2, 3]), tmp_path, workers=0, work=sweep_work.quick).rows) == [1, 2, 3]
    assert measured(log) == {1: 1, 2: 1, 3: 2}
    lines = path.read_text().splitlines()
    assert len(lines) == 3
    assert all(json.loads(line)["status"] == "done" for line in lines)


def test_damage_in_the_middle_costs_its_own_line_only(tmp_path: Path, log: Path) -> None:
    sweep(spec([1, 2, 3]), tmp_path, workers=0, work=sweep_work.quick)
    path = tmp_path / "results.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b'{"id": 7}\n\xff\n' + lines[2])
    found = sweep(spec([1, 2, 3]), tmp_path, workers=0, work=sweep_work.quick)
    assert measured(log) == {1: 1, 2: 2, 3: 1}
    assert "2 lines of results.jsonl are no rows, and are passed over" in found.notes


@pytest.mark.parametrize("lost", ["point", "status", "memory_bytes"])
def test_a_row_without_what_is_read_of_it_is_damage(lost: str, tmp_path: Path, log: Path) -> None:
    sweep(spec([1, 2]), tmp_path, workers=0, work=sweep_work.quick)
    path = tmp_path / "results.jsonl"
    first, second = path.read_text().splitlines()
    row = json.loads(first)
    del row[lost]
    path.write_text(f"{json.dumps(row)}\n{second}\n")
    found = sweep(spec([1, 2]), tmp_path, workers=0, work=sweep_work.quick)
    assert heights(found.rows) == [1, 2]
    assert measured(log) == {1: 2, 2: 1}
    assert "1 lines of results.jsonl are no rows, and are passed over" in found.notes


def test_two_runs_at_once_in_one_folder_are_refused(tmp_path: Path, log: Path) -> None:
    with Store(tmp_path / "out"), pytest.raises(OutputError, match="another sweep is writing there"):
        sweep(spec([1]), tmp_path / "out", workers=0, work=sweep_work.quick)
    assert not measured(log)
    assert heights(sweep(spec([1]), tmp_path / "out", workers=0, work=sweep_work.quick).rows) == [1]


def test_a_place_that_cannot_be_written_is_found_first(tmp_path: Path, log: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        sweep(spec([1]), tmp_path / "out", workers=0, work=sweep_work.quick)
    assert not measured(log)


def test_a_full_disk_stops_the_run_and_keeps_what_is_done(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, left = os.write, [2]

    def full(file: int, data: bytes) -> int:
        if not left[0]:
            write(file, data[:10])  # a part fits
            raise OSError(28, os.strerror(28))
        left[0] -= 1
        return write(file, data)

    monkeypatch.setattr(sweep_store.os, "write", full)
    with pytest.raises(OutputError, match=r"No space left on device; the 2 rows before are kept") as error:
        sweep(spec([1, 2, 3, 4]), tmp_path / "out", workers=0, work=sweep_work.quick)
    assert "\n" not in str(error.value)
    monkeypatch.undo()
    monkeypatch.setenv("SWEEP_LOG", str(log))
    assert heights(sweep(spec([1, 2, 3, 4]), tmp_path / "out", workers=0, work=sweep_work.quick).rows) == [1, 2, 3, 4]
    assert measured(log) == {1: 1, 2: 1, 3: 2, 4: 1}


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
def test_the_system_may_refuse_to_write_more(tmp_path: Path, log: Path) -> None:
    """As a full disk does; with a worker process at work."""
    program = (
        "import resource, sweep_work\n"
        "from tyndall.lab.sweep import sweep\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))\n"
        f"sweep({spec(range(1, 9))!r}, {str(tmp_path / 'out')!r}, work=sweep_work.large)\n"
    )
    result = _python(program)
    assert result.returncode == 1
    with Store(tmp_path / "out") as store:
        kept = len(store.rows)
    assert 1 <= kept < 8
    assert result.stderr.splitlines()[-1].endswith(f"File too large; the {kept} rows before are kept")


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_run_loses_a_point_a_worker_and_goes_on(workers: int, tmp_path: Path, log: Path) -> None:
    program = (
        "import sweep_work\n"
        "from tyndall.lab.sweep import sweep\n"
        f"sweep({spec(range(1, 13))!r}, {str(tmp_path / 'out')!r}, workers={workers}, work=sweep_work.slow)\n"
    )
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    environment = {**_environment(), "TMPDIR": str(scratch)}
    process = subprocess.Popen([sys.executable, "-c", program], env=environment, stderr=subprocess.PIPE)
    rows = tmp_path / "out/results.jsonl"
    deadline = time.monotonic() + 60
    while not (rows.exists() and rows.read_bytes().count(b"\n") >= 4):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    while any(psutil.pid_exists(int(path.suffix[1:])) for path in log.parent.glob("log.*")):
        assert time.monotonic() < deadline, "workers end with their parent"
        time.sleep(0.02)
    assert not list(scratch.iterdir()), "and leave nothing"
    with Store(tmp_path / "out") as store:
        kept = set(heights(list(store.rows.values())))
    before = measured(log)
    assert len(before) - len(kept) <= workers
    found = sweep(spec(range(1, 13)), tmp_path / "out", workers=0, work=sweep_work.quick)
    assert heights(found.rows) == list(range(1, 13))
    assert found.reused == len(kept)
    after = measured(log)
    assert all(after[height] == 1 for height in kept)


# --- workers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_a_worker_that_dies_is_tried_once_more_and_then_reported(workers: int, tmp_path: Path, log: Path) -> None:
    found = sweep(spec([1, 2, 3, 4, 5]), tmp_path, workers=workers, work=sweep_work.deadly)
    assert heights(found.rows) == [2, 3, 4, 5]
    (failed,) = found.failed
    assert failed["point"]["size"] == [8, 1]
    assert failed["reason"] == "the worker died (signal 9)"
    assert failed["attempts"] == 2
    assert measured(log) == {1: 2, 2: 2, 3: 2, 4: 1, 5: 1}
    assert "1 point could not be measured: the worker died (signal 9)" in found.notes
    assert "the worker died (signal 9)" in str(found)
    again = sweep(spec([1, 2, 3, 4, 5]), tmp_path, workers=0, work=sweep_work.quick)
    assert (again.failed, again.reused) == ([], 4)


def test_workers_leave_no_folders_behind(tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    monkeypatch.setenv("TMPDIR", str(scratch))
    seen = sweep(spec([2, 3]), tmp_path / "out", workers=2, work=sweep_work.littered)
    assert any(row["folders"] for row in seen.rows), "there were some"
    assert not list(scratch.iterdir())


def test_workers_of_a_scheduler_that_exists_are_used(tmp_path: Path, log: Path) -> None:
    import dask
    import distributed

    with (
        dask.config.set({"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}),
        distributed.LocalCluster(
            n_workers=1,
            processes=False,
            host="127.0.0.1",
            protocol="tcp",
            dashboard_address=None,
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            local_directory=str(tmp_path / "dask"),
        ) as cluster,
    ):
        found = sweep(spec([4, 5, 6]), tmp_path / "out", scheduler=cluster.scheduler_address, work=sweep_work.quick)
    assert heights(found.rows) == [4, 5, 6]


def test_a_scheduler_that_does_not_answer_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tyndall.lab.sweep_workers._CONNECT_S", 0.2)
    with pytest.raises(ParameterError, match="scheduler: no Dask scheduler answers at tcp://127.0.0.1:9"):
        sweep(spec([1]), tmp_path, scheduler="tcp://127.0.0.1:9")


def test_a_sweep_listens_on_the_loopback_interface_alone() -> None:
    from tyndall.lab.sweep_workers import local_workers

    with local_workers(1) as workers:
        assert workers[0][0].ask("sweep_work:address", {}) == {"status": "done", "reason": None, "ports": ["127.0.0.1"]}
        ours = [c.laddr.ip for c in psutil.Process().net_connections("inet") if c.status == psutil.CONN_LISTEN]
        assert set(ours) == {"127.0.0.1"}


def test_mistakes_of_the_call_are_told(gpu: Gpu, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="workers: -1 is fewer than 0"):
        sweep(spec([1]), tmp_path, workers=-1)
    with pytest.raises(ParameterError, match="workers: 2; a scheduler has its own"):
        sweep(spec([1]), tmp_path, workers=2, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(ParameterError, match="a device is not shared with other processes"):
        sweep(spec([1]), tmp_path, adapter=gpu)
    with pytest.raises(ParameterError, match="format: 'xls'"):
        sweep(spec([1]), tmp_path, table="xls")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_a_judge_that_is_missing_is_told_once_and_before_any_point(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    missing = Availability(None, ("Mitsuba is not installed: pip install 'tyndall[truth]'",))
    monkeypatch.setattr("tyndall.lab.sweep.available", lambda: missing)
    asked = {**spec([1, 2]), "truth": "mitsuba"}
    with pytest.raises(MitsubaError, match="Mitsuba is not installed"):
        sweep(asked, tmp_path, workers=0, work=sweep_work.quick)
    assert not measured(log)
    assert heights(sweep(spec([1, 2]), tmp_path, workers=0, work=sweep_work.quick).rows) == [1, 2]
    monkeypatch.setattr("tyndall.lab.sweep.available", lambda: Availability(Variant("scalar_rgb", None, "3"), ()))
    assert heights(sweep(asked, tmp_path, workers=0, work=sweep_work.quick).rows) == [1, 2]


# --- what is measured -----------------------------------------------------------------------------------------------


def test_points_are_drawn_and_held_against_the_truth(gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path / "cache"))
    save(Scene(lights=(PointLight(),)), tmp_path / "lamp.json")
    found = sweep(
        {
            "frames": 2,
            "warmup": 1,
            "sizes": "32x18",
            "parameters": {"froxel": {"grid": [[8, 4, 8], [32, 18, 32]]}},
            "parts": [
                {"scenes": "box", "techniques": ["off", "froxel"], "truth": "march"},
                {"scenes": "box", "techniques": "off", "truth": {"judge": "traced", "target": 0.2}, "frames": 0},
                {"scenes": str(tmp_path / "lamp.json"), "techniques": {"technique": "froxel", "model": "paper"}},
            ],
        },
        tmp_path / "out",
        adapter=gpu,
        workers=0,
        table="csv",
    )
    off, coarse, fine, traced, *lamps = found.rows
    assert [row["status"] for row in found.rows] == 4 * ["done"] + 2 * ["unsupported"]
    assert all("directional" in row["reason"] for row in lamps)
    errors = [row["errors"]["inscattered"]["rel_rmse"] for row in (off, coarse, fine)]
    assert errors[0] > errors[1] > errors[2] > 0
    assert off["errors"]["inscattered"]["bias"] == -1
    assert coarse["memory_bytes"] < fine["memory_bytes"]
    assert fine["gpu_ms"]["min"] <= fine["gpu_ms"]["median"] <= fine["gpu_ms"]["p95"]
    assert set(fine["passes"]) >= {"volumetric.froxel.scatter", "frame"}
    assert fine["truth"]["judge"] == "march"
    assert traced["gpu_ms"] is None
    assert traced["truth"]["judge"] == "traced"
    assert 0 < traced["truth"]["relative_error"]["inscattered"] <= 0.2
    assert traced["errors"]["inscattered"]["bias"] == -1
    assert traced["adapter"] == gpu.adapter_info["device"]
    table = list(csv.DictReader(found.table_file.read_text(encoding="utf-8").splitlines()))
    assert [row["froxel.grid"] for row in table[:3]] == ["", "8x4x8", "32x18x32"]
    assert float(table[2]["gpu_ms.median"]) == fine["gpu_ms"]["median"]


def test_a_point_of_another_adapter_is_measured_again_where_one_is_asked_for(
    gpu: Gpu, tmp_path: Path, log: Path
) -> None:
    mine = gpu.adapter_info["device"]
    sweep(spec([4, 5]), tmp_path, workers=0, work=sweep_work.quick)  # on an adapter called "none"
    again = sweep(spec([4, 5]), tmp_path, workers=0, work=sweep_work.quick)
    assert again.reused == 2
    found = sweep(spec([4, 5]), tmp_path, workers=0, adapter=mine, work=sweep_work.drawn)
    assert (found.reused, {row["adapter"] for row in found.rows}) == (0, {mine})
    assert found.notes[0] == f"2 points are measured again, now on {mine}"
    kept = sweep(spec([4, 5]), tmp_path, workers=0, adapter=mine, work=sweep_work.drawn)
    assert kept.reused == 2
    assert measured(log) == {4: 2, 5: 2}


def test_an_adapter_that_is_not_there_is_told_even_where_nothing_is_left(tmp_path: Path, log: Path) -> None:
    sweep(spec([4]), tmp_path, workers=0, work=sweep_work.quick)
    with pytest.raises(GpuError, match="no adapter matches 'nowhere'"):
        sweep(spec([4]), tmp_path, workers=0, adapter="nowhere", work=sweep_work.quick)


def test_what_cannot_be_drawn_is_told_and_the_rest_goes_on(gpu: Gpu, tmp_path: Path) -> None:
    sizes = [[10**6, 4], [16, 9]]
    point = {"scenes": "box", "techniques": "off", "sizes": sizes, "frames": 0}
    large, small = sweep(point, tmp_path, adapter=gpu, workers=0).rows
    assert large["status"] == "failed"
    assert "limit" in large["reason"]
    assert small["status"] == "done"


def test_each_stage_has_its_own_judge_and_a_truth_is_traced_once(
    gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path / "cache"))
    traced: list[object] = []

    def counted(*args: Any, **kwargs: Any) -> Truth:
        traced.append(args)
        return trace(*args, **kwargs)

    monkeypatch.setattr(standard, "trace", counted)
    maps = [{"technique": "shadow_map", "size": size} for size in (16, 32, 64)]
    common = {"scenes": "box", "techniques": "polygonal", "shadow": maps, "sizes": "24x14", "frames": 0}
    coarse = {"judge": "march", "shadow": {"technique": "shadow_map", "size": 16}}
    parts = [
        {"truth": "march"},
        {"truth": coarse},
        {"truth": {"judge": "traced", "target": 0.5}, "metrics": "light"},
    ]
    found = sweep({**common, "parts": parts}, tmp_path / "out", adapter=gpu, workers=0)
    errors = [row["errors"]["inscattered"]["rel_rmse"] for row in found.rows]
    own, against_coarse = errors[:3], errors[3:6]
    assert against_coarse[0] == pytest.approx(own[0], rel=1e-3), "the same map"
    assert against_coarse[2] > 2 * own[2], "another map"
    assert len(traced) == 1


# --- the table ------------------------------------------------------------------------------------------------------


def test_a_row_is_flat_in_a_table() -> None:
    point = {
        "scene": "box",
        "size": [64, 36],
        "technique": {"technique": "froxel", "grid": [8, 4, 2]},
        "shadow": {"technique": "shadow_map", "size": 512},
        "truth": {"judge": "march"},
    }
    row = {"id": "1", "point": point, "gpu_ms": {"median": 1.5}, "passes": {"frame": 2}}
    assert flat(row) == {
        "id": "1",
        "scene": "box",
        "width": 64,
        "height": 36,
        "technique": "froxel",
        "froxel.grid": "8x4x2",
        "shadow": "shadow_map",
        "shadow_map.size": 512,
        "asked.truth.judge": "march",
        "gpu_ms.median": 1.5,
        "passes.frame": 2,
    }
    columns = columns_of([{"a": 1, "b": "x"}, {"a": 2.5}, {"b": 3, "c": None}])
    assert columns == {"a": [1.0, 2.5, None], "b": ["x", None, "3"], "c": [None, None, None]}


def test_brackets_in_names_and_reasons_are_shown_as_they_are(tmp_path: Path, log: Path) -> None:
    names = ["y[red].json", "z[dim].json"]
    for name in names:
        save(Scene(), tmp_path / name)
    paths = [str(tmp_path / name) for name in names]
    found = sweep({"scenes": paths, "techniques": "off"}, tmp_path / "out", workers=0, work=sweep_work.quick)
    shown = str(replace(found, notes=("pip install 'tyndall[sweep]'", "[/x]")))
    assert all(text in shown for text in (*names, "pip install 'tyndall[sweep]'", "[/x]"))
    one = sweep({"scenes": paths[0], "techniques": "off"}, tmp_path / "one", workers=0, work=sweep_work.quick)
    assert names[0] in str(one), "in the title"


def test_parquet_holds_the_rows(tmp_path: Path, log: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    found = sweep(spec([1, 2]), tmp_path, workers=0, table="parquet", work=sweep_work.quick)
    columns = parquet.read_table(found.table_file).to_pydict()
    assert columns["height"] == [1, 2]
    assert columns["gpu_ms.median"] == [1.0, 1.0]


def _environment() -> dict[str, str]:
    paths = [str(ROOT / "src"), str(ROOT / "tests")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def _python(program: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program]
    return subprocess.run(command, env=_environment(), capture_output=True, text=True, check=False, timeout=120)
