"""The benchmark of implicit surfaces, beside the same scenes as one plain loop in one shader.

``tyndall bench sdf`` measures, on one adapter and in one run:

- **scenes**: ``portrait``, ``snail``, ``jumper`` and ``temple`` with shadows and ambient occlusion at 1920×1080, still
  and in motion, for half a minute each: frames per second, GPU time by pass, host time; beside them S5's own numbers
  (:mod:`tyndall.lab.s5`);
- **swarm**: 10 to 10,000 smooth-blended primitives, still and all moving;
- **edits**: host time to move a leaf, all leaves, or an object, among 10,000 primitives, and the bytes written for it;
- **first**: the first picture in a process of its own, without and with what the driver keeps of earlier ones'
  pipelines, and in a program that draws already;
- **agreement**: pruned cells against whole programs at a million random points, also after a move;
- **loops**: the plain loop (:mod:`tyndall.lab.baseline`) in the same scenes and swarms, as a fragment and as a compute
  shader: as literal code, which cannot move, and swarms as a loop over an array too, which can.

Ours is the time of the whole frame: G-buffer, shadows, ambient occlusion, lighting, composite and tone mapping, in
buffers that meshes, air and antialiasing share. The loop's is that of its one pass. Frames are drawn one at a time and
timed by the GPU; "frames per second" are those that a program draws which waits after each batch of
:data:`BATCH`, with the host's work in them.

What cannot be measured is written down with its reason, and the others go on; with a folder, the document is saved
after each figure. ``quick`` measures the same things in small.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, nearest
from tyndall.lab import bench_sdf_tables as tables
from tyndall.lab import s5
from tyndall.lab.busy import Busy
from tyndall.lab.field_check import agreement
from tyndall.lab.figures import Figures, text_of, timed_device
from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.lab.first_picture import Order, in_a_process, run, techniques_of
from tyndall.lab.measure import Times, measure
from tyndall.lab.picture import check_folder, write_texts
from tyndall.lab.scenes import open_scene
from tyndall.lab.stage import adapter_name, driver_name
from tyndall.scene.model import Scene, transforms
from tyndall.sdf import sphere, union
from tyndall.sdf.field import Field

NAME = "sdf"
PARTS = ("scenes", "swarm", "edits", "first", "agreement", "loops")
_ROWS = ("scenes", "swarm", "first", "agreement")  # what a document has by scenes
FRAME: Mapping[str, str] = {
    "volumetric": "off",
    "shadow": "field",
    "occlusion": "field_ao",
    "antialiasing": "none",
    "tonemap": "aces",
}
# As the plain loop does it: one ray to each light, values along the normal.
CHANGES: Mapping[str, Mapping[str, Any]] = {"field": {"cones": 1}, "field_ao": {"cones": 1}}
BATCH = 32  # frames between two waits, where frames per second are counted
STEP = 1 / 60  # s of a scene's own time from frame to frame
_MOST_LITERAL = 2000  # primitives; a compiler has no end with more
_TURN = 20.0  # s that a loop takes at most, beside its measurement, when it is its turn to draw

Progress = Callable[[float, str], object]
Row = dict[str, Any]


@dataclass(frozen=True)
class Settings:
    """What is measured. The defaults are S5's settings and more; :data:`QUICK` is the same in small.

    Attributes:
        seconds: of each of our frames' measurements; the plain loop gets at most ``loop_seconds``.
        timeout: seconds after which a process that has no picture is ended.
        processes: whether first pictures and literal code get processes of their own.
    """

    parts: tuple[str, ...] = PARTS
    size: tuple[int, int] = s5.SIZE
    scenes: tuple[str, ...] = tuple(s5.FPS)
    swarm: tuple[int, ...] = (10, 100, 1_000, 10_000)
    edited: int = 10_000
    first: tuple[str, ...] = ("swarm:1000", "temple")
    agreement: tuple[str, ...] = (*s5.FPS, "swarm:1000")
    points: int = 1_000_000
    seconds: float = float(s5.SECONDS)
    loop_seconds: float = 5.0
    frames: int = 100_000
    warmup: int = 8
    edits: int = 50
    timeout: float = 90.0
    processes: bool = True


QUICK = Settings(
    size=(160, 90),
    scenes=("jumper",),
    swarm=(10, 100),
    edited=100,
    first=("swarm:100",),
    agreement=("jumper", "swarm:100"),
    points=20_000,
    seconds=1.0,
    loop_seconds=1.0,
    frames=5,
    warmup=1,
    edits=5,
    timeout=30.0,
)


class SdfBench(Figures):
    """The figures of one run."""

    name = NAME

    def markdown(self) -> str:
        """All tables, as they stand in ``docs/benchmarks.md``."""
        return tables.markdown(self.document)


def sdf(
    adapter: str | Gpu | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    quick: bool = False,
    seconds: float | None = None,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> SdfBench:
    """Measure everything that the module lists.

    Args:
        adapter: part of an adapter's name, or a device to share.
        out: folder for the document, as it grows, and the tables.
        quick: :data:`QUICK` instead of S5's settings.
        seconds: of each measurement of our frames, in place of the settings' own.
        settings: others than these two.
        progress: hears a fraction of 1 and what is being measured.

    Raises:
        GpuError: no such adapter, or one that cannot time what it draws.
        ParameterError: no such part.
        OutputError: ``out`` cannot be written.
    """
    chosen = settings or (QUICK if quick else Settings())
    if seconds is not None:
        chosen = dataclasses.replace(chosen, seconds=seconds, loop_seconds=min(seconds, chosen.loop_seconds))
    for part in chosen.parts:
        if part not in PARTS:
            raise ParameterError(f"parts: no part '{part}'{nearest(part, PARTS)} (there are {', '.join(PARTS)})")
    if out is not None:
        check_folder(Path(out))
    with timed_device(adapter) as gpu:
        work = _Run(gpu, chosen, Path(out) if out is not None else None, progress)
        work.all()
    bench = SdfBench(work.document)
    if out is not None:
        bench.save(out)
    return bench


def join(documents: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Documents of several runs on one adapter, each of some parts or scenes, as one; of what several have, the last
    one's. ``runs`` then says what each of them measured, and how.

    Raises:
        ParameterError: none, of another benchmark, of several adapters, or of pictures of several sizes.
    """
    if not documents or any(document.get("benchmark") != NAME for document in documents):
        raise ParameterError(f"documents: not all of this benchmark, '{NAME}'")
    if len({document["adapter"] for document in documents}) != 1:
        raise ParameterError("documents: not of one adapter")
    if len({tuple(document["settings"]["size"]) for document in documents}) != 1:
        raise ParameterError("documents: not of pictures of one size")
    runs = [run for document in documents for run in document.get("runs", [_run(document)])]
    joined: dict[str, Any] = {}
    for document in documents:
        for key, value in document.items():
            if key in _ROWS:
                rows = {row["scene"]: row for row in joined.get(key, [])}
                for row in value:
                    both = key in ("scenes", "swarm") and row["scene"] in rows
                    rows[row["scene"]] = _joined_row(rows[row["scene"]], row) if both else row
                joined[key] = sorted(rows.values(), key=lambda row: row.get("count", 0))
            elif key != "failed":
                joined[key] = value
    joined["runs"] = sorted(runs, key=lambda run: str(run["date"]))
    failed = [{"what": what, "reason": reason} for what, reason in tables.failures(joined)]
    return {**joined, "failed": failed} if failed else joined


def _joined_row(first: Row, last: Row) -> Row:
    """A row of two runs: figures of ours are of one of them; of the plain loop, each way is."""
    if len({row["scene_hash"] for row in (first, last) if "scene_hash" in row}) > 1:
        return last  # another scene by now: its figures cannot stand beside the old ones
    ways: Row = {kind: {**first[kind], **last[kind]} for kind in ("loop", "listed") if kind in first and kind in last}
    return {**first, **last, **ways}


def _run(document: Mapping[str, Any]) -> Row:
    """What a document says of its run."""
    return {
        **{key: document[key] for key in ("date", "versions", "settings")},
        "parts": tables.parts_of(document),
    }


class _Moving:
    """A renderer whose scene's own time goes on from frame to frame."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer, self._time = renderer, 0.0

    def draw(self) -> float:
        self._time += STEP
        return self._renderer.draw(time=self._time)

    def timings(self) -> dict[str, float]:
        return self._renderer.timings()

    def memory(self) -> dict[str, int]:
        return self._renderer.memory()


class _Run:
    """The figures, one after another."""

    def __init__(self, gpu: Gpu, settings: Settings, out: Path | None, progress: Progress | None) -> None:
        self._gpu, self._s, self._out = gpu, settings, out
        self._progress = progress or (lambda fraction, text: None)
        self._done, self._planned = 0, self._count()
        self._held: tuple[str, Scene] | None = None
        self.document: dict[str, Any] = {
            "benchmark": NAME,
            "date": date.today().isoformat(),
            "adapter": adapter_name(gpu),
            "adapter_type": gpu.adapter_info["adapter_type"],
            "driver": driver_name(gpu),
            "versions": versions(),
            "settings": {
                "size": list(settings.size),
                "seconds": settings.seconds,
                "loop_seconds": settings.loop_seconds,
                "frame": {family: _told(name) for family, name in FRAME.items()},
            },
            "scenes": [],
        }

    def _count(self) -> int:
        s = self._s
        codes = [count for count in s.swarm if count <= _MOST_LITERAL]
        sizes = {
            "scenes": len(s.scenes),
            "swarm": len(s.swarm),
            "edits": 1,
            "first": len(s.first),
            "agreement": len(s.agreement),
            "loops": 2 * (len(s.scenes) + len(s.swarm) + len(codes)),
        }
        return max(1, sum(sizes[part] for part in s.parts))

    def all(self) -> None:
        """Every part."""
        for part in self._s.parts:
            getattr(self, f"_{part}")()

    # --- parts --------------------------------------------------------------------------------------------------------

    def _scenes(self) -> None:
        for name in self._s.scenes:
            self._ours("scenes", name)

    def _swarm(self) -> None:
        for count in self._s.swarm:
            self._ours("swarm", f"swarm:{count}")

    def _loops(self) -> None:
        s = self._s
        stages = ("fragment", "compute")
        swarms = [("swarm", f"swarm:{count}") for count in s.swarm]
        literal = [(p, n) for p, n in swarms if int(n.partition(":")[2]) <= _MOST_LITERAL]
        codes = [
            (p, self._sized(Order(n, w))) for p, n in [*(("scenes", n) for n in s.scenes), *literal] for w in stages
        ]
        limit = s.timeout + (s.loop_seconds + _TURN) * len(codes)
        # Literal code takes a compiler of one thread minutes: all of it at once, while nothing else is measured.
        with ThreadPoolExecutor(max(1, (os.cpu_count() or 1) - 1)) as pool:
            begun: dict[Future[Row], tuple[str, Order]] = {}
            for part, order in codes if s.processes else ():
                begun[pool.submit(in_a_process, order, timeout=limit, keep_compiled=False)] = part, order
            self._progress(self._done / self._planned, f"compiling {len(begun)} loops at once")
            for future in as_completed(begun):
                self._loop(*begun[future], future)
        for part, order in () if s.processes else codes:
            self._loop(part, order)
        for part, name in swarms:
            for stage in stages:
                self._loop(part, self._sized(Order(name, stage, loops=True)))
        for part, name in swarms:
            if (part, name) not in literal:
                for stage in stages:
                    reason = f"not tried: {name.partition(':')[2]} primitives as code"
                    self._row(part, name).setdefault("loop", {})[stage] = {"failed": reason}

    def _sized(self, order: Order) -> Order:
        s = self._s
        return dataclasses.replace(
            order,
            size=s.size,
            seconds=s.loop_seconds,
            frames=s.frames,
            adapter=self.document["adapter"],
            patience=s.timeout if s.processes and not order.loops else 0.0,
            in_turn=not order.loops,
        )

    def _row(self, part: str, name: str) -> Row:
        """The row of a scene, anew or as it is so far."""
        rows = self.document.setdefault(part, [])
        for row in rows:
            if row["scene"] == name:
                found: Row = row
                return found
        new: Row = {"scene": name, **({"count": int(name.partition(":")[2])} if part == "swarm" else {})}
        rows.append(new)
        return new

    def _scene(self, name: str) -> Scene:
        """A scene by its name; the last one is kept."""
        if self._held is None or self._held[0] != name:
            self._held = name, open_scene(name)
        return self._held[1]

    def _ours(self, part: str, name: str) -> None:
        row = self._row(part, name)

        def found() -> Row:
            scene = self._scene(name)
            row.update(facts(scene))
            figures: Row = {}
            with Renderer(scene, self._s.size, gpu=self._gpu, **techniques_of(scene, FRAME, CHANGES)) as renderer:
                figures["still"] = self._measured(renderer, renderer)
                figures["memory"] = renderer.memory()
                figures["uploaded_still"] = renderer.uploaded
                if scene.motion is not None:
                    figures["moving"] = self._measured(renderer, _Moving(renderer))
                    figures["uploaded_moving"] = renderer.uploaded
            return figures

        self._step(name)
        row["ours"] = self._tried(name, found) or {"failed": self._reason}
        self._save()

    def _measured(self, renderer: Renderer, drawn: Any) -> Row:
        gpu, s = self._gpu, self._s
        drawn.draw()  # compiles; that must not be of the time for measuring
        gpu.wait()
        with Busy(gpu) as busy:
            taken = measure(drawn, frames=s.frames, warmup=s.warmup, budget_s=s.seconds, before=busy)
        fps = frames_per_second(drawn.draw, gpu.wait, min(s.seconds, 3.0), s.frames)
        frame = taken.frame or Times(0.0, 0.0, 0.0)
        return {
            "frame_ms": frame.to_json(),
            "host_ms": taken.host.to_json(),
            "passes": {n: round(t.median, 6) for n, t in taken.passes.items() if n != "frame"},
            "fps": round(fps, 2),
            "frames": taken.frames,
        }

    def _loop(self, part: str, order: Order, begun: Future[Row] | None = None) -> None:
        name = order.scene
        row = self._row(part, name)

        def found() -> Row:
            scene = self._scene(name)
            row.update(facts(scene))
            return begun.result() if begun is not None else run(order, self._gpu, scene)

        text = f"{name} as {'a list' if order.loops else 'code'}, {order.who}"
        self._step(text)
        into = row.setdefault("listed" if order.loops else "loop", {})
        into[order.who] = self._tried(text, found) or {"failed": self._reason}
        self._save()

    def _edits(self) -> None:
        name = f"swarm:{self._s.edited}"
        self._step(f"edits of {name}")
        found = self._tried(name, lambda: self._edited(name))
        self.document["edits"] = found or {"scene": name, "failed": self._reason}
        self._save()

    def _edited(self, name: str) -> Row:
        """Host times of edits, each with the frame that shows it."""
        scene, s = self._scene(name), self._s
        index = largest(scene)
        one = scene.implicits[index]
        shape: Any = one.shape
        low, high = shape.box
        place = tuple(float(x) for x in (low + high) / 2)
        leaf = sphere(0.02 * float((high - low).max())).named("the one").at(*place)
        joined = dataclasses.replace(one, shape=union(shape, leaf, smooth=0.0), name="the object")
        implicits = tuple(joined if i == index else other for i, other in enumerate(scene.implicits))
        scene = scene.with_(implicits=implicits)
        motion = scene.motion
        rows: dict[str, Row] = {}
        with Renderer(scene, s.size, gpu=self._gpu, **techniques_of(scene, FRAME, CHANGES)) as renderer:
            renderer.draw()
            self._gpu.wait()
            turns = [np.eye(4) for _ in range(s.edits)]
            for i, turn in enumerate(turns):
                turn[:3, 3] = 0.001 * i, 0, 0
            placement = np.asarray(joined.transform)
            rows["nothing"] = self._edit(renderer, [lambda: None] * s.edits)
            rows["a leaf"] = self._edit(renderer, [partial(renderer.move, "the one", t) for t in turns])
            places = [t @ placement for t in turns]
            rows["the object"] = self._edit(renderer, [partial(renderer.place, "the object", p) for p in places])
            if motion is not None:
                given = [motion(STEP * i) for i in range(s.edits)]
                rows["all leaves"] = self._edit(renderer, [partial(_move_all, renderer, g) for g in given])
                begin = time.perf_counter()
                for i in range(s.edits):
                    motion(STEP * i)
                rows["the scene's own motion"] = {
                    "edit_ms": Times.of([(time.perf_counter() - begin) * 1e3 / s.edits]).to_json()
                }
        return {"scene": name, **facts(scene), "rows": rows}

    def _edit(self, renderer: Renderer, edits: list[Callable[[], object]]) -> Row:
        calls, draws, gpu_ms = [], [], []
        uploaded = 0
        for edit in edits:
            begin = time.perf_counter()
            edit()
            calls.append((time.perf_counter() - begin) * 1e3)
            draws.append(renderer.draw())
            uploaded = renderer.uploaded
            gpu_ms.append(renderer.timings().get("frame", 0.0))
        return {
            "edit_ms": Times.of(calls).to_json(),
            "draw_ms": Times.of(draws).to_json(),
            "frame_ms": Times.of(gpu_ms).to_json(),
            "uploaded": uploaded,
        }

    def _first(self) -> None:
        rows = self.document.setdefault("first", [])
        for name in self._s.first:
            self._step(f"first picture of {name}")
            order = Order(
                name, size=self._s.size, adapter=self.document["adapter"], techniques=dict(FRAME), changes=CHANGES
            )
            scene = self._tried(name, partial(self._scene, name))
            if scene is None:
                rows.append({"scene": name, "failed": self._reason})
                continue
            row: Row = {"scene": name, **facts(scene)}
            rows.append(row)
            for kind, keep in (("new", False), ("kept", True), ("kept", True)):  # what is kept must be made first
                if self._s.processes:
                    row[kind] = in_a_process(order, timeout=self._s.timeout, keep_compiled=keep)
            found = self._tried(name, partial(run, order, self._gpu, scene))
            row["running"] = found or {"failed": self._reason}
            self._save()

    def _agreement(self) -> None:
        rows = self.document.setdefault("agreement", [])
        for name in self._s.agreement:
            self._step(f"agreement in {name}")
            found = self._tried(name, partial(self._agreed, name))
            rows.append(found or {"scene": name, "failed": self._reason})
            self._save()

    def _agreed(self, name: str) -> Row:
        scene, gpu = self._scene(name), self._gpu
        motion = scene.motion
        with Field(gpu, scene.implicits) as field:
            still = agreement(gpu, field, scene.implicits, self._s.points)
            row: Row = {"scene": name, **facts(scene), "still": still.to_json()}
            used, kept = field.counters().sum(axis=0)
            row["cells"] = {"entries": int(used), "overflows": int(kept)}
            if motion is not None:
                at = scene.at_time(1.25)
                for part, matrices in motion(1.25).items():
                    move_any(field, scene, part, matrices)
                row["moved"] = agreement(gpu, field, at.implicits, self._s.points, seed=1).to_json()
        return row

    # --- how it goes --------------------------------------------------------------------------------------------------

    def _step(self, text: str) -> None:
        self._progress(self._done / self._planned, text)
        self._done = min(self._done + 1, self._planned)

    def _tried[T](self, what: str, work: Callable[[], T]) -> T | None:
        """The work's result; None where it failed, for a reason that is then kept."""
        self._reason = ""
        try:
            return work()
        except Exception as fault:
            self._gpu.discard()
            self._reason = f"{type(fault).__name__}: {fault}".splitlines()[0]
            self.document.setdefault("failed", []).append({"what": what, "reason": self._reason})
            return None

    def _save(self) -> None:
        if self._out is not None:
            write_texts(self._out, {f"{NAME}.json": text_of(self.document)})


def _told(name: str) -> str:
    """A technique's name and what is changed of it."""
    return " ".join([name, *(f"{key}={value}" for key, value in CHANGES.get(name, {}).items())])


def _move_all(renderer: Renderer, moves: Mapping[str, Any]) -> None:
    for name, matrices in moves.items():
        renderer.move(name, matrices)


def facts(scene: Scene) -> Row:
    """What a scene is, for a row."""
    shapes: list[Any] = [implicit.shape for implicit in scene.implicits]
    return {
        "scene_hash": scene_hash(scene),
        "objects": len(shapes),
        "nodes": sum(shape.count for shape in shapes),
        "lights": len(scene.lights),
    }


def largest(scene: Scene) -> int:
    """The number of the object of the most nodes."""
    shapes: list[Any] = [implicit.shape for implicit in scene.implicits]
    return max(range(len(shapes)), key=lambda i: shapes[i].count)


def move_any(field: Field, scene: Scene, name: str, moves: ArrayLike) -> None:
    """Move what a scene's motion names: objects first, then parts."""
    matrices = transforms(name, moves)
    objects = [i for i, implicit in enumerate(scene.implicits) if implicit.name == name]
    for index, matrix in zip(objects, matrices, strict=False):
        field.place(index, matrix @ np.asarray(scene.implicits[index].transform))
    if len(matrices) > len(objects):
        field.move(name, matrices[len(objects) :])


def frames_per_second(
    draw: Callable[[], object], wait: Callable[[], object], seconds: float, frames: int = 1_000_000
) -> float:
    """Frames that a program draws in a second which waits for the device after each batch of :data:`BATCH`."""
    begin = time.perf_counter()
    drawn = 0
    while drawn < 2 or (time.perf_counter() - begin < seconds and drawn < frames):
        for _ in range(min(BATCH, max(1, frames - drawn))):
            draw()
            drawn += 1
        wait()
    return drawn / (time.perf_counter() - begin)
