"""Sweeps: time, bytes and error of many techniques, scenes, lights, sizes and parameters, in one folder.

What is measured is a specification (:mod:`tyndall.lab.sweep_spec`); it is refused whole where anything in it is wrong.
Its points are measured one by one, by one process or by several, each on its own device
(:mod:`tyndall.lab.sweep_workers`), and each row is on the disk before its worker begins the next point
(:mod:`tyndall.lab.sweep_store`). So a sweep can be stopped at any moment, and goes on where it was: a point that is
done is never repeated, and one that an earlier specification of the same folder shares with this one counts as done.

A point whose worker dies is tried once more, by a new one, and then reported as failed with the reason; so is a point
that cannot be drawn; the others go on. When the disk is full, the sweep stops, and keeps what it has.
"""

from __future__ import annotations

import json
import os
import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyndall.gpu.device import Gpu, choose_adapter
from tyndall.gpu.params import ParameterError
from tyndall.lab.mitsuba import MitsubaError, available
from tyndall.lab.picture import write_atomically
from tyndall.lab.sweep_point import measure_point
from tyndall.lab.sweep_spec import Plan, Point, SweepError, read
from tyndall.lab.sweep_store import RESULTS, Format, Row, Store, save_table, table_format
from tyndall.lab.sweep_workers import Child, Died, Here, Worker, check_dask, local_workers, remote_workers

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["Sweep", "SweepError", "sweep"]

Progress = Callable[[float, str], object]
Work = Callable[[Mapping[str, Any]], dict[str, Any]]

_ATTEMPTS = 2


@dataclass(frozen=True)
class Sweep:
    """A sweep that has run to its end.

    Attributes:
        rows: plain data, a row a point, in the order of the specification.
        folder: where ``results.jsonl`` and the table are; None for a sweep that was kept nowhere.
        table_file: the table, Parquet or CSV.
        reused: how many points had been measured before.
        notes: what a reader of the rows should know, a line each.
    """

    rows: Sequence[Row] = field(repr=False)
    folder: Path
    table_file: Path
    reused: int
    notes: tuple[str, ...]

    @property
    def failed(self) -> list[Row]:
        """The rows of points that could not be measured."""
        return [row for row in self.rows if row["status"] == "failed"]

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``."""
        return {"folder": str(self.folder), "reused": self.reused, "notes": list(self.notes), "rows": list(self.rows)}

    def table(self) -> Table:
        """For a terminal or a notebook, by rich: what varies, time, memory and error."""
        from tyndall.lab.sweep_table import table

        return table(self.rows, self.notes)

    def __str__(self) -> str:
        from rich.console import Console

        text = StringIO()
        Console(file=text, width=150).print(self.table())
        return text.getvalue().rstrip("\n")


def sweep(
    spec: str | os.PathLike[str] | Mapping[str, Any] | Plan,
    out: str | os.PathLike[str],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    adapter: str | Gpu | None = None,
    table: Format | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
    work: Work = measure_point,
) -> Sweep:
    """Measure all points of a specification that its folder does not have yet.

    Args:
        spec: path of a JSON file, its contents as Python data, or a plan that was read before.
        out: folder for the results.
        workers: how many processes measure; more than one are Dask's. 0 measures in this process: quick to start, but
            a driver that crashes takes the caller with it.
        scheduler: address of a Dask scheduler whose workers measure, one point at a time each, instead; ``workers``
            is 1 then.
        adapter: part of an adapter's name; or a device to share, which only this process (``workers=0``) can. Points
            that were measured on another one are measured again, but by the workers of a scheduler, whose adapters
            are not known here. None takes rows of any adapter, and says where they are of several.
        table: "parquet" or "csv"; None is Parquet where pyarrow is installed, and CSV where it is not.
        fresh: measure everything again; the new rows take the place of the old.
        progress: hears a fraction of 1 and what is being measured.
        work: does a task; a function of a module that workers can import. See
            :func:`tyndall.lab.sweep_point.measure_point`.

    Raises:
        SweepError: the specification is wrong; one line for each mistake.
        ParameterError: a number of workers below 0 or beside a scheduler, no such scheduler, or a library that is
            missing.
        MitsubaError: a point that is left needs Mitsuba, and it does not run here; nothing was measured.
        GpuError: this machine has no such adapter.
        OutputError: the folder cannot be written, or another sweep writes there; or it is full: what was measured
            before that is kept.
        SchedulerError: the scheduler ended during the sweep; likewise.
    """
    if workers < 0 or isinstance(workers, bool):
        raise ParameterError(f"workers: {workers} is fewer than 0")
    if scheduler is not None and workers != 1:
        raise ParameterError(f"workers: {workers}; a scheduler has its own workers, and all of them measure")
    if isinstance(adapter, Gpu) and (workers or scheduler is not None):
        raise ParameterError("adapter: a device is not shared with other processes; workers=0 measures in this one")
    kind = table_format(table)
    if scheduler is not None or workers > 1:
        check_dask()
    plan = spec if isinstance(spec, Plan) else read(spec)
    wanted = None if scheduler is not None else _device(adapter)
    with Store(out) as store:
        write_atomically(store.folder / "spec.json", lambda path: _write_json(path, plan.spec))
        write_atomically(store.folder / "points.json", lambda path: _write_json(path, [p.id for p in plan.points]))
        final = set() if fresh else {p.id for p in plan.points if _final(store.rows.get(p.id))}
        known = {id for id in final if wanted is None or store.rows[id].get("adapter") in (wanted, None)}
        notes = _beginning(plan, store, len(known), fresh)
        if final != known:
            notes.append(f"{len(final - known)} points are measured again, now on {wanted}")
        run = _Run(plan, store, known, progress, work)
        run.refuse()
        if scheduler is None and run.needs("mitsuba") and (mitsuba := available()).variant is None:
            raise MitsubaError(str(mitsuba))
        if isinstance(adapter, Gpu) or (not workers and scheduler is None):
            run.inline(adapter)
        elif run.left:
            with ExitStack() as stack:
                if scheduler is not None:
                    found = stack.enter_context(remote_workers(scheduler))
                elif workers > 1:
                    found = stack.enter_context(local_workers(min(workers, run.left)))
                else:
                    child = Child()
                    stack.callback(child.end)
                    found = [(child, 0)]
                run.shared(found, adapter)
        rows = [store.rows[point.id] for point in plan.points]
        path = save_table(rows, store.folder, kind)
        notes += _ending(rows)
        return Sweep(rows, store.folder, path, len(known), tuple(notes))


def _device(adapter: str | Gpu | None) -> str | None:
    """The name that rows of an adapter have; None where none was asked for.

    Raises:
        GpuError: there is no such adapter.
    """
    if adapter is None:
        return None
    return str(adapter.adapter_info["device"] if isinstance(adapter, Gpu) else choose_adapter(adapter).info["device"])


def _final(row: Row | None) -> bool:
    """Whether a point is not to be measured again; one that failed is."""
    return row is not None and row["status"] in ("done", "unsupported")


def _write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _beginning(plan: Plan, store: Store, known: int, fresh: bool) -> list[str]:
    notes = []
    if known:
        notes.append(
            f"{known} of {len(plan.points)} points were measured before ({store.path}); fresh measures them again"
        )
    elif fresh and store.rows:
        notes.append(f"what {store.path} held of these points is measured again")
    asked = {point.id for point in plan.points}
    if aside := sum(1 for id in store.rows if id not in asked):
        notes.append(f"{aside} rows in {RESULTS} are not of this specification; they are kept there, and left out here")
    if store.damaged:
        notes.append(f"{store.damaged} lines of {RESULTS} are no rows, and are passed over")
    return notes


def _ending(rows: Sequence[Row]) -> list[str]:
    notes = []
    for name, text in (("failed", "could not be measured"), ("unsupported", "cannot be drawn")):
        if own := [row["reason"] for row in rows if row["status"] == name]:
            others = f"; and {len(set(own)) - 1} other reasons" if len(set(own)) > 1 else ""
            notes.append(f"{len(own)} point{'s' * (len(own) != 1)} {text}: {own[0]}{others}")
    for name, words in (("adapter", "adapters"), ("driver", "drivers")):
        found = dict.fromkeys(row[name] for row in rows if row.get(name))
        if len(found) > 1:
            notes.append(f"the rows come from {len(found)} {words}: {', '.join(found)}")
    found = dict.fromkeys(v["tyndall"] for row in rows if (v := row.get("versions")) and "tyndall" in v)
    if len(found) > 1:
        notes.append(f"the rows come from {len(found)} versions of Tyndall: {', '.join(found)}")
    return notes


class _Run:
    """The points that are left, and who measures them."""

    def __init__(self, plan: Plan, store: Store, known: set[str], progress: Progress | None, work: Work) -> None:
        self._store, self._progress, self._work = store, progress, work
        self._waiting = [point for point in plan.points if point.id not in known]
        self._total, self._done, self._text = len(self._waiting), 0, ""
        self._lock = threading.Lock()
        self._busy: dict[int, str] = {}  # the stage that each worker has
        self._stop = threading.Event()

    @property
    def left(self) -> int:
        """How many points are not measured yet."""
        return self._total - self._done

    def needs(self, judge: str) -> bool:
        """Whether errors of a point that is left are against this judge."""
        return any((point.description["truth"] or {}).get("judge") == judge for point in self._waiting)

    def refuse(self) -> None:
        """Rows for the points whose technique refuses their scene."""
        for point in [p for p in self._waiting if p.refusal is not None]:
            self._waiting.remove(point)
            self._add(point, {"status": "unsupported", "reason": point.refusal})

    def inline(self, adapter: str | Gpu | None) -> None:
        """Measure in this process."""
        worker = Here(adapter if isinstance(adapter, Gpu) else None)
        name = adapter if isinstance(adapter, str) else None
        try:
            while (point := self._take(0)) is not None:
                self._tell(str(point))
                self._add(point, self._asked(worker, _task(point, name, 0)))
        finally:
            worker.end()

    def shared(self, workers: Sequence[tuple[Worker, int]], adapter: str | None) -> None:
        """Measure by several workers, given with their ranks. A worker's row is written before it has its next point;
        progress is told by this thread alone."""
        events: queue.SimpleQueue[tuple[Point, bool] | BaseException | None] = queue.SimpleQueue()
        writing = threading.Lock()

        def serve(number: int, worker: Worker, rank: int) -> None:
            try:
                while not self._stop.is_set() and (point := self._take(number)) is not None:
                    events.put((point, False))
                    answer = self._asked(worker, _task(point, adapter, rank))
                    with writing:
                        if self._stop.is_set():
                            break
                        self._write(point, answer)
                    events.put((point, True))
            except BaseException as error:
                self._stop.set()
                events.put(error)
            finally:
                events.put(None)

        threads = [
            threading.Thread(target=serve, args=(number, *pair), name=f"sweep-{number}", daemon=True)
            for number, pair in enumerate(workers)
        ]
        for thread in threads:
            thread.start()
        try:
            running = len(threads)
            while running:
                event = events.get()
                if event is None:
                    running -= 1
                elif isinstance(event, BaseException):
                    raise event
                else:
                    point, measured = event
                    self._done += measured
                    self._tell("" if measured else str(point))
        finally:
            self._stop.set()
            for worker, _ in workers:
                worker.end()
            for thread in threads:
                thread.join()

    def _asked(self, worker: Worker, task: Mapping[str, Any]) -> dict[str, Any]:
        """A worker's answer; where it dies, or fails in a way that nobody foresaw, that of a second attempt."""
        reasons = []
        for _ in range(_ATTEMPTS):
            try:
                answer = worker.ask(_name(self._work), task)
            except Died as death:
                reasons.append(f"the worker died ({death})")
            else:
                if answer["status"] != "crashed":
                    return answer
                reasons.append(answer["reason"])
            if self._stop.is_set():
                break
        return {"status": "failed", "reason": "; then ".join(dict.fromkeys(reasons)), "attempts": len(reasons)}

    def _take(self, number: int) -> Point | None:
        """The next point for a worker: one of the stage that it has, else of a stage that nobody has, else any."""
        with self._lock:
            mine = self._busy.pop(number, None)
            others = set(self._busy.values())
            for wanted in (lambda p: p.stage == mine, lambda p: p.stage not in others, lambda p: True):
                point = next(filter(wanted, self._waiting), None)
                if point is not None:
                    self._waiting.remove(point)
                    self._busy[number] = point.stage
                    return point
            return None

    def _add(self, point: Point, answer: Mapping[str, Any]) -> None:
        self._write(point, answer)
        self._done += 1
        self._tell("")

    def _write(self, point: Point, answer: Mapping[str, Any]) -> None:
        status = {name: answer[name] for name in ("status", "reason")}
        figures = {name: value for name, value in answer.items() if name not in status}
        row = {"id": point.id, **status, "point": point.description, "scene_hash": point.scene_hash, **figures}
        self._store.add(row)

    def _tell(self, text: str) -> None:
        if self._progress:
            self._text = text or self._text
            self._progress(self._done / max(1, self._total), f"{self._done} of {self._total} · {self._text}")


def _task(point: Point, adapter: str | None, rank: int) -> dict[str, Any]:
    return {"point": point.description, "scene_hash": point.scene_hash, "adapter": adapter, "rank": rank}


def _name(work: Work) -> str:
    return f"{work.__module__}:{work.__qualname__}"
