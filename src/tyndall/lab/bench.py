"""The benchmark of the volumetric techniques, at the settings of the study that this project repeats.

``tyndall bench volumetric`` measures, on one adapter and in one run of a few minutes:

- **scenes**: each technique in each bundled scene with one directional light: GPU time of its passes and of the frame,
  host time of the frame, and memory;
- **lights**: each technique in ``box`` with 1 to 32 lights, with a straight line fitted to its time and its memory;
- **resolution**: how each technique's error against the converged march falls, and its time and memory rise, with its
  own resolution: froxels, shadow-map texels under the polygonal mesh, screen-space samples, march steps.

The settings are those of S1, *Comparison of volumetric-light techniques* (2025): 2134×1459 pixels, shadow maps of
1024², 190×90×128 froxels, 64 screen-space samples; :mod:`tyndall.lab.bench_tables` sets its figures beside these,
as those of another machine. ``quick`` measures the same things in small, for a test or a software adapter.
"""

from __future__ import annotations

import datetime
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import replace
from tyndall.lab import bench_tables, metrics
from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.lab.measure import Measurement, measure
from tyndall.lab.picture import check_folder, write_atomically
from tyndall.lab.reference import Reference, find
from tyndall.lab.stage import Overrides, Stage, adapter_name, describe, driver_name, make
from tyndall.scene import bundled
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Technique

Progress = Callable[[float, str], object]
Triple = tuple[int, int, int]

# As measured: a technique, or "technique/choice" for another of its ways to do the same.
TECHNIQUES = ("off", "froxel", "screen_space", "polygonal", "polygonal/faces", "march")
_CHOICES: Mapping[str, Mapping[str, Any]] = {"faces": {"evaluate": "faces"}}


@dataclass(frozen=True)
class Settings:
    """What is measured. The defaults are S1's settings and more; :data:`QUICK` is the same in small."""

    size: tuple[int, int] = (2134, 1459)
    shadow_size: int = 1024
    grid: Triple = (190, 90, 128)
    samples: int = 64
    scenes: tuple[str, ...] = ("box", "blinds", "courtyard")
    lights: tuple[int, ...] = (1, 2, 4, 8, 16, 32)
    error_scenes: tuple[str, ...] = ("box", "blinds")
    grids: tuple[Triple, ...] = ((48, 23, 32), (95, 45, 64), (190, 90, 128), (380, 180, 256))
    shadow_sizes: tuple[int, ...] = (256, 512, 1024, 2048, 4096)
    sample_counts: tuple[int, ...] = (16, 32, 64, 128, 256)
    step_counts: tuple[int, ...] = (16, 32, 64, 128, 256)
    frames: int = 200
    warmup: int = 60
    seconds: float = 5.0  # the most that one measurement may take; a GPU never needs it

    def parameters(self) -> Overrides:
        """Parameters of the techniques at these settings, by technique name."""
        return {
            "froxel": {"grid": self.grid},
            "screen_space": {"samples": self.samples},
            "shadow_map": {"size": self.shadow_size},
        }


QUICK = Settings(
    size=(320, 180),
    shadow_size=256,
    grid=(80, 45, 32),
    samples=32,
    scenes=("box",),
    lights=(1, 2, 4),
    error_scenes=("box",),
    grids=((40, 23, 16), (80, 45, 32)),
    shadow_sizes=(128, 256),
    sample_counts=(16, 32),
    step_counts=(16, 32),
    frames=4,
    warmup=1,
    seconds=2.0,
)


@dataclass(frozen=True)
class Bench:
    """The figures of one run, as plain data (:meth:`to_json`), tables (:meth:`markdown`)."""

    document: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``."""
        return dict(self.document)

    def markdown(self) -> str:
        """All tables, as they stand in ``docs/benchmarks.md``."""
        return bench_tables.markdown(self.document)

    def __str__(self) -> str:
        return self.markdown()

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write ``volumetric.json`` and ``volumetric.md``.

        Raises:
            OutputError: ``folder`` is a file, or the system refuses.
        """
        target = Path(folder)
        check_folder(target)
        target.mkdir(parents=True, exist_ok=True)
        text = json.dumps(self.document, indent=1, ensure_ascii=False) + "\n"
        write_atomically(target / "volumetric.json", lambda path: _write(path, text))
        write_atomically(target / "volumetric.md", lambda path: _write(path, self.markdown()))
        return target


def volumetric(
    adapter: str | Gpu | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    quick: bool = False,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> Bench:
    """Measure everything that the module lists.

    Args:
        adapter: part of an adapter's name, or a device to share.
        out: folder for the figures as JSON and as tables, written again after each part, so that an interruption loses
            one part only.
        quick: :data:`QUICK` instead of S1's settings.
        settings: others than these two.
        progress: hears a fraction of 1 and what is being measured.

    Raises:
        GpuError: no such adapter, or one that cannot draw at these settings, or not time what it draws.
        OutputError: ``out`` cannot be written.
    """
    if out is not None:
        check_folder(Path(out))
    chosen = settings or (QUICK if quick else Settings())
    owned = not isinstance(adapter, Gpu)
    gpu = adapter if isinstance(adapter, Gpu) else Gpu(adapter)
    try:
        run = _Run(chosen, gpu, progress)
        document = run.head()
        for part, measured in (("scenes", run.scenes), ("lights", run.lights), ("resolution", run.resolution)):
            document[part] = measured()
            if out is not None:
                Bench(document).save(out)
        return Bench(document)
    finally:
        if owned:
            gpu.close()


def line(x: Sequence[float], y: Sequence[float]) -> dict[str, float]:
    """The least-squares line through points: ``{"intercept", "slope", "r2"}``; r2 is 1 where every y is equal."""
    slope, intercept = np.polyfit(np.asarray(x, float), np.asarray(y, float), 1)
    values = np.asarray(y, float)
    residual = float(((values - (intercept + slope * np.asarray(x, float))) ** 2).sum())
    total = float(((values - values.mean()) ** 2).sum())
    return {
        "intercept": float(intercept),
        "slope": float(slope),
        "r2": 1 - residual / total if total > 1e-12 * max(1.0, float((values**2).sum())) else 1.0,
    }


class _Run:
    """One run: settings, device, and how far it is."""

    def __init__(self, settings: Settings, gpu: Gpu, progress: Progress | None) -> None:
        self.settings, self.gpu, self._progress = settings, gpu, progress
        self._made: dict[tuple[str, int], Scene] = {}
        s = settings
        sweeps = len(s.grids) + len(s.sample_counts) + 2 * len(s.shadow_sizes) + len(s.step_counts) + 2
        self._total = len(TECHNIQUES) * (len(s.scenes) + len(s.lights)) + len(s.error_scenes) * sweeps
        self._done = 0

    def head(self) -> dict[str, Any]:
        """What every figure depends on."""
        s = self.settings
        return {
            "benchmark": "volumetric",
            "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
            "adapter": adapter_name(self.gpu),
            "adapter_type": str(self.gpu.adapter_info["adapter_type"]),
            "driver": driver_name(self.gpu),
            "versions": versions(),
            "settings": {
                "size": list(s.size),
                "shadow_size": s.shadow_size,
                "grid": list(s.grid),
                "samples": s.samples,
                "frames": s.frames,
                "warmup": s.warmup,
            },
        }

    def scenes(self) -> list[dict[str, Any]]:
        """Each technique in each scene."""
        rows = []
        for name in self.settings.scenes:
            scene = self._scene(name)
            digest = scene_hash(scene)
            with self._stage(scene) as stage:
                for label, technique in self._techniques(scene):
                    self._tell(f"{name}, {label}")
                    row = {"scene": name, "triangles": scene.triangle_count, "scene_hash": digest}
                    rows.append({**row, **self._row(stage, technique), "technique": label})
        return rows

    def lights(self) -> dict[str, Any]:
        """Each technique in box with more and more lights, and the lines through its time and memory."""
        rows: dict[str, list[dict[str, Any]]] = {}
        for count in self.settings.lights:
            scene = self._scene("box", count)
            with self._stage(scene) as stage:
                for label, technique in self._techniques(scene):
                    self._tell(f"{count} lights, {label}")
                    row = {"lights": count, **self._row(stage, technique), "technique": label}
                    rows.setdefault(label, []).append(row)
        return {
            name: {
                "rows": measured,
                "time_fit": line([r["lights"] for r in measured], [r["gpu_ms"]["median"] for r in measured]),
                "memory_fit": line([r["lights"] for r in measured], [_both(r) for r in measured]),
            }
            for name, measured in rows.items()
        }

    def resolution(self) -> dict[str, Any]:
        """Error, time and memory against each technique's own resolution."""
        return {name: self._resolution(self._scene(name)) for name in self.settings.error_scenes}

    def _resolution(self, scene: Scene) -> dict[str, Any]:
        s = self.settings
        with self._stage(scene) as stage:
            self._tell(f"{scene.name}, reference")
            truth = self._reference(stage)
            sweeps: dict[str, list[dict[str, Any]]] = {
                "froxel": self._sweep(stage, "froxel", "grid", s.grids, truth),
                "screen_space": self._sweep(stage, "screen_space", "samples", s.sample_counts, truth),
                "march": self._sweep(stage, "march", "steps", s.step_counts, truth),
            }
        # The polygonal mesh has one vertex a texel, so its resolution is the map's. Its own error is against a march on
        # the same map; the map's error comes on top, and shows against a march on the finest map.
        finest = None
        sweeps["polygonal"] = []
        for size in sorted(s.shadow_sizes, reverse=True):
            with self._stage(scene, shadow_size=size) as stage:
                self._tell(f"{scene.name}, reference on a shadow map of {size}²")
                same = self._reference(stage)
                finest = finest or same
                (row,) = self._sweep(stage, "polygonal", None, [size], same)
                still = stage.still(self._technique("polygonal", scene))
                row |= {"against_finest": _errors(still.light, finest.still.light)}
                sweeps["polygonal"].insert(0, row)
        return {
            "scene_hash": scene_hash(scene),
            "reference": truth.to_json(),
            "sweeps": sweeps,
        }

    def _sweep(
        self, stage: Stage, name: str, parameter: str | None, values: Iterable[Any], truth: Reference
    ) -> list[dict[str, Any]]:
        rows = []
        for value in values:
            self._tell(f"{stage.scene.name}, {name} at {_value(value)}")
            technique = self._technique(name, stage.scene)
            if parameter is not None:
                technique = replace(technique, {parameter: value})
            row = self._row(stage, technique)
            light = stage.still(technique).light
            rows.append({"resolution": value, **row, "error": _errors(light, truth.still.light)})
        return rows

    def _row(self, stage: Stage, technique: Technique) -> dict[str, Any]:
        s = self.settings
        measured = measure(stage.use(technique), frames=s.frames, warmup=s.warmup, budget_s=s.seconds)
        return {"technique": technique.name, "parameters": describe(technique), **_figures(measured)}

    def _reference(self, stage: Stage) -> Reference:
        return find(stage, budget_s=4 * self.settings.seconds)

    def _technique(self, name: str, scene: Scene) -> Technique:
        return make("volumetric", name, scene, self.settings.parameters())

    def _techniques(self, scene: Scene) -> list[tuple[str, Technique]]:
        made = []
        for label in TECHNIQUES:
            name, _, choice = label.partition("/")
            made.append((label, replace(self._technique(name, scene), _CHOICES.get(choice, {}))))
        return made

    def _scene(self, name: str, lights: int = 1) -> Scene:
        key = (name, lights)
        if key not in self._made:
            self._say(f"building {name}")
            self._made[key] = bundled.SCENES[name](lights=lights)
        return self._made[key]

    def _stage(self, scene: Scene, shadow_size: int | None = None) -> Stage:
        s = self.settings
        parameters = {"shadow_map": {"size": shadow_size or s.shadow_size}}
        return Stage(scene, s.size, shadow="shadow_map", parameters=parameters, adapter=self.gpu)

    def _tell(self, text: str) -> None:
        self._say(text)
        self._done += 1

    def _say(self, text: str) -> None:
        if self._progress:
            self._progress(min(1.0, self._done / self._total), text)


def _figures(measured: Measurement) -> dict[str, Any]:
    technique, shadow, frame = measured.technique("volumetric"), measured.technique("shadow"), measured.frame
    if technique is None or shadow is None or frame is None:
        raise GpuError("this adapter cannot time what it draws (timestamp-query), and a benchmark is of times")
    return {
        "gpu_ms": technique.to_json(),
        "frame_ms": frame.to_json(),
        "shadow_ms": shadow.to_json(),
        "host_ms": measured.host.to_json(),
        "passes": {name: round(times.median, 6) for name, times in measured.passes.items()},
        "memory_bytes": measured.bytes_of("volumetric"),
        "shadow_bytes": measured.bytes_of("shadow"),
        "memory": dict(measured.memory),
        "frames": measured.frames,
    }


def _errors(light: NDArray[np.float32], truth: NDArray[np.float32]) -> dict[str, float | None]:
    return {"rel_rmse": metrics.rel_rmse(light, truth), "bias": metrics.bias(light, truth)}


def _both(row: Mapping[str, Any]) -> float:
    """Bytes of a technique with the shadow maps that it reads."""
    return float(row["memory_bytes"] + row["shadow_bytes"])


def _value(value: Any) -> str:
    return "×".join(map(str, value)) if isinstance(value, (tuple, list)) else str(value)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
