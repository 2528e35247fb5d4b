"""One point of a sweep, measured: what a worker does.

A worker is told a point as plain data and answers with plain data. It keeps its device, and the scene, the stage and
the judge's picture of the point before, so that points of one stage that follow each other build nothing twice.
Everything that touches the device happens under a lock of that device's name, so that what is timed runs alone on it;
errors are worked out after the lock is given back, unless the device is the processor itself.
"""

from __future__ import annotations

import contextlib
import datetime
import importlib
import json
import math
import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, replace
from tyndall.gpu.resources import Closing
from tyndall.lab import bundled, metrics, standard
from tyndall.lab.compare import SOFT_FRAMES, is_soft
from tyndall.lab.filelock import device_lock
from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.lab.measure import belongs, measure
from tyndall.lab.metrics import Target
from tyndall.lab.reference import find
from tyndall.lab.scenes import open_scene
from tyndall.lab.stage import Stage, Still
from tyndall.lab.sweep_spec import OTHERS
from tyndall.lab.truth import Truth, TruthSettings
from tyndall.scene.model import Scene
from tyndall.sdf.marching import Marching
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Technique

Plain = dict[str, Any]


def technique_of(family: str, described: Mapping[str, Any]) -> Technique:
    """The technique that :func:`tyndall.lab.stage.describe` described."""
    values = {name: value for name, value in described.items() if name != "technique"}
    return replace(FAMILIES[family].find(described["technique"])(), values)


class Station(Closing):
    """A device, and what the last point left on it.

    Args:
        adapter: part of an adapter's name, or a device to share; a shared one is left open.
        rank: which of several adapters of that name, modulo their number.

    Raises:
        GpuError: no such adapter.
    """

    def __init__(self, adapter: str | Gpu | None = None, rank: int = 0) -> None:
        self._owned = not isinstance(adapter, Gpu)
        self.gpu = adapter if isinstance(adapter, Gpu) else Gpu(adapter, rank=rank)
        self._lock = f"{self.gpu.adapter_info['device']} {self.gpu.rank}"
        self._draws_on_processor = self.gpu.adapter_info["adapter_type"] == "CPU"
        self._scene: tuple[Any, Scene] | None = None
        self._stage: tuple[Any, Stage] | None = None
        self._judged: tuple[Any, dict[str, Target], Plain] | None = None
        self._truth: tuple[Any, Truth] | None = None

    def measure(self, point: Mapping[str, Any], expected: str) -> Plain:
        """The figures of a point: its row, but for what tells it apart.

        Args:
            point: as :class:`tyndall.lab.sweep_spec.Point` describes it.
            expected: the hash of its scene.

        Raises:
            ParameterError: the scene is another one here.
            GpuError, Unsupported, SceneError: what is asked for cannot be drawn here.
        """
        begun = time.monotonic()
        scene = self._open(point["scene"], point["lights"], expected)
        technique = technique_of("volumetric", point["technique"])
        errors = None
        with device_lock(self._lock):
            stage = self._prepare(scene, point)
            judged = self._judge(stage, point)
            figures = _figures(stage, technique, point)
            # Shadows of lights with a size are sampled: a still gathers some frames, as those of a comparison do.
            still = stage.still(technique, frames=SOFT_FRAMES if is_soft(scene) else 1) if judged else None
            if judged and still and self._draws_on_processor:
                errors = _errors(still, judged[0], point["metrics"])
        if judged and still and not self._draws_on_processor:
            errors = _errors(still, judged[0], point["metrics"])
        return {
            "scene_name": scene.name,
            "triangles": scene.triangle_count,
            **figures,
            "errors": errors,
            "truth": judged[1] if judged else None,
            "adapter": stage.adapter,
            "adapter_type": str(self.gpu.adapter_info["adapter_type"]),
            "driver": stage.driver,
            "versions": versions(),
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "seconds": round(time.monotonic() - begun, 3),
        }

    def _open(self, name: str, lights: int, expected: str) -> Scene:
        key = (name, lights, expected)
        if self._scene is None or self._scene[0] != key:
            self._forget()
            scene = open_scene(name, lights if bundled.named(name) is not None else None)
            if scene_hash(scene) != expected:
                raise ParameterError(f"scene: {name} is not what it was when the sweep was planned")
            self._scene = key, scene
        return self._scene[1]

    def _prepare(self, scene: Scene, point: Mapping[str, Any]) -> Stage:
        marching = point.get(Marching.name)
        key = [marching, *(point[name] for name in ("size", *OTHERS, "seed"))]  # another scene forgets it
        if self._stage is None or self._stage[0] != key:
            if self._stage is not None:
                self._stage[1].close()
            self._stage = self._judged = None
            others: dict[str, Any] = {family: technique_of(family, point[family]) for family in OTHERS}
            width, height = point["size"]
            parameters = {Marching.name: marching} if marching else {}
            stage = Stage(scene, (width, height), parameters=parameters, adapter=self.gpu, seed=point["seed"], **others)
            self._stage = key, stage
        return self._stage[1]

    def _judge(self, stage: Stage, point: Mapping[str, Any]) -> tuple[dict[str, Target], Plain] | None:
        """What errors are held against, by kind of light, and how it was made."""
        asked = point["truth"]
        if asked is None:
            return None
        key = (asked, point["metrics"])  # of this stage: another stage forgets it
        if self._judged is None or self._judged[0] != key:
            made = _marched(stage, asked) if asked["judge"] == "march" else self._traced(stage, asked, point["metrics"])
            self._judged = (key, *made)
        return self._judged[1:]

    def _traced(self, stage: Stage, asked: Mapping[str, Any], figures: str) -> tuple[dict[str, Target], Plain]:
        """A truth is one for all stages of a scene and a size, whatever their shadows are made of."""
        key = (stage.size, asked)  # of this scene: another scene forgets it
        known: str | Truth = asked["judge"]
        if self._truth is not None and self._truth[0] == key:
            known = self._truth[1]
        settings = TruthSettings(**{name: value for name, value in asked.items() if name != "judge"})
        found = standard.prepare(stage, "volumetric", known, settings)
        self._truth = key, found.truth
        targets = dict(found.targets)
        if figures == "all":
            targets |= standard.prepare(stage, "shadow", found.truth).targets
        return targets, {
            "judge": found.truth.judge,
            "samples": found.truth.samples,
            "relative_error": {kind: _rounded(error) for kind, error in found.noise.items()},
            "seconds": round(found.truth.seconds, 3),
        }

    def _forget(self) -> None:
        if self._stage is not None:
            self._stage[1].close()
        self._scene = self._stage = self._judged = self._truth = None

    def close(self) -> None:
        """Free everything but a device that was given."""
        self._forget()
        if self._owned:
            self.gpu.close()


def _marched(stage: Stage, asked: Mapping[str, Any]) -> tuple[dict[str, Target], Plain]:
    """A march that has converged, through the stage's own shadows or through others."""
    if "shadow" in asked:
        kept: dict[str, Any] = {**stage.techniques, "shadow": technique_of("shadow", asked["shadow"])}
        with Stage(stage.scene, stage.size, adapter=stage.gpu, seed=stage.seed, **kept) as other:
            found = find(other, budget_s=asked["seconds"])
    else:
        found = find(stage, budget_s=asked["seconds"])
    targets = {kind: Target(found.still.of(kind)) for kind in ("inscattered", "radiance")}
    return targets, {"judge": "march", **found.to_json()}


def _figures(stage: Stage, technique: Technique, point: Mapping[str, Any]) -> Plain:
    """Times and bytes; the times are null where none were asked for, or where the adapter has no timer."""
    renderer = stage.use(technique)
    if not point["frames"]:
        renderer.draw()
        return {
            **dict.fromkeys(("gpu_ms", "shadow_ms", "frame_ms", "host_ms")),
            **_bytes(renderer.memory()),
            "frames": 0,
        }
    measured = measure(renderer, frames=point["frames"], warmup=point["warmup"], budget_s=point["seconds"])
    times = {
        "gpu_ms": measured.technique("volumetric"),
        "shadow_ms": measured.technique("shadow"),
        "frame_ms": measured.frame,
        "host_ms": measured.host,
    }
    return {
        **{name: found.to_json() if found else None for name, found in times.items()},
        "passes": {name: round(found.median, 6) for name, found in measured.passes.items()},
        **_bytes(measured.memory),
        "frames": measured.frames,
    }


def _bytes(memory: Mapping[str, int]) -> Plain:
    def of(family: str) -> int:
        return sum(size for owner, size in memory.items() if belongs(owner, family))

    return {"memory_bytes": of("volumetric"), "shadow_bytes": of("shadow"), "memory": dict(memory)}


def _errors(still: Still, targets: Mapping[str, Target], asked: str) -> Plain:
    """Figures of :mod:`tyndall.lab.metrics` by kind of light."""
    if asked == "light":
        light, target = still.light, targets["inscattered"]
        figures = {
            "rel_rmse": metrics.rel_rmse(light, target.light),
            "rel_rmse_corrected": metrics.rel_rmse(light, target.light, target.error),
            "bias": metrics.bias(light, target.light),
        }
        return {"inscattered": {name: _rounded(value) for name, value in figures.items()}}
    with ThreadPoolExecutor(len(targets)) as pool:  # numpy and FLIP let other threads run
        scores = pool.map(lambda kind: metrics.score(still.of(kind), targets[kind]).to_json(), targets)
        return dict(zip(targets, scores, strict=True))


def _rounded(value: float | None) -> float | None:
    """JSON has no infinity."""
    return float(f"{value:.6g}") if value is not None and math.isfinite(value) else None


# --- a worker -----------------------------------------------------------------------------------------------------

_stations: dict[tuple[str | None, int], Station] = {}  # of this process, by adapter


def measure_point(task: Mapping[str, Any]) -> Plain:
    """What a worker process does with a task, ``{"point", "scene_hash", "adapter", "rank"}``.

    See :meth:`Station.measure`; ``rank`` spreads the workers of a machine over its adapters of the same name.
    """
    key = (task["adapter"], task["rank"])
    if key not in _stations:
        _stations[key] = Station(*key)
    try:
        return _stations[key].measure(task["point"], task["scene_hash"])
    except Exception as error:
        if not _foreseen(error):
            close_stations()  # a device may be lost: the next attempt is made on a new one
        raise


def close_stations() -> None:
    """Free the devices that :func:`measure_point` has opened in this process."""
    while _stations:
        with contextlib.suppress(Exception):
            _stations.popitem()[1].close()


def attempt(work: str, task: Mapping[str, Any]) -> Plain:
    """Do a task with the function that is named ``package.module:function``, and say how it went.

    See :func:`attempted`.
    """
    module, _, name = work.partition(":")
    return attempted(lambda: getattr(importlib.import_module(module), name)(task))


def attempted(measured: Callable[[], Plain]) -> Plain:
    """Figures, and how it went: ``status`` and ``reason``.

    ``status`` is "done"; or "failed", where the reason was foreseen (one line, as a person would read it) and another
    attempt would end alike; or "crashed", where it was not.
    """
    try:
        figures = measured()
    except Exception as error:
        return {"status": "failed" if _foreseen(error) else "crashed", "reason": _line(error)}
    return {"status": "done", "reason": None, **figures}


def _foreseen(error: Exception) -> bool:
    kind = type(error)
    return kind.__module__.startswith("tyndall.") and kind.__name__ != "ShaderError"


def _line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if _foreseen(error) else f"{type(error).__name__}: {text}"


def serve() -> None:
    """The worker's side of :class:`tyndall.lab.sweep_workers.Child`: a task a line, an answer a line.

    It ends when its input does, at once: nobody waits for the answer any more.
    """
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin.buffer:
            lines.put(line)
        os._exit(1)

    # What a library prints must not get among the answers.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as answers:
        os.dup2(2, 1)
        threading.Thread(target=read, daemon=True).start()
        while True:
            request = json.loads(lines.get())
            answers.write(json.dumps(attempt(request["work"], request["task"])) + "\n")
            answers.flush()
