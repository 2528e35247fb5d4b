"""The benchmark of the volumetric techniques, at the settings of the study that this project repeats.

``tyndall bench volumetric`` is a sweep (:mod:`tyndall.lab.sweep`), on one adapter and in one run of a few minutes:

- **scenes**: each technique in each bundled scene with one directional light: GPU time of its passes and of the frame,
  host time of the frame, and memory;
- **lights**: each technique in ``box`` with 1 to 32 lights, with a straight line fitted to its time and its memory;
- **resolution**: how each technique's error against the converged march falls, and its time and memory rise, with its
  own resolution: froxels, shadow-map texels under the polygonal mesh, screen-space samples, march steps;
- **truth**: the error of each technique, and of the converged march, against a traced truth, whose visibility comes
  from rays and not from a shadow map.

The settings are those of S1, *Comparison of volumetric-light techniques* (2025): 2134×1459 pixels, shadow maps of
1024², 190×90×128 froxels, 64 screen-space samples; :mod:`tyndall.lab.bench_tables` sets its figures beside these,
as those of another machine. Errors against truth are of smaller pictures, as truth is dear. ``quick`` measures the same
things in small, for a test or a software adapter.

The rows are those of any sweep (``results.jsonl`` and a table), and a run that was stopped goes on where it was.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tyndall.gpu.device import Gpu, GpuError, choose_adapter
from tyndall.lab import bench_tables
from tyndall.lab.figures import Figures, check_times, text_of
from tyndall.lab.picture import check_folder
from tyndall.lab.stage import Overrides
from tyndall.lab.sweep import sweep
from tyndall.lab.sweep_spec import Plan, plan
from tyndall.scene import bundled

Progress = Callable[[float, str], object]
Triple = tuple[int, int, int]
Rows = Mapping[str, Mapping[str, Any]]

# As measured: a technique, or "technique/choice" for another of its ways to do the same.
TECHNIQUES = ("off", "froxel", "screen_space", "polygonal", "polygonal/faces", "march")
_CHOICES: Mapping[str, Mapping[str, Any]] = {"faces": {"evaluate": "faces"}}
_JUDGED = ("off", "screen_space", "froxel", "polygonal", "march")  # against truth; both ways of polygonal are one there

NAME = "volumetric"


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
    truth_scenes: tuple[str, ...] = ("box", "blinds", "courtyard")
    truth_size: tuple[int, int] = (640, 360)
    truth_target: float = 0.01  # relative standard error
    truth_seconds: float = 15.0  # the most that one truth may take
    truth_steps: int = 2048  # of a march that has converged
    truth_shadow_sizes: tuple[int, ...] = (1024, 4096)  # of the maps that it reads
    frames: int = 100
    warmup: int = 20
    seconds: float = 2.5  # the most that one measurement may take; a GPU seldom needs it

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
    truth_scenes=("box",),
    truth_size=(160, 90),
    truth_target=0.05,
    truth_steps=256,
    truth_shadow_sizes=(256, 1024),
    frames=4,
    warmup=1,
    seconds=2.0,
)


class Bench(Figures):
    """The figures of one run, and plots of them (:meth:`plots`)."""

    name = NAME

    def markdown(self, images: str | None = None) -> str:
        """All tables, as they stand in ``docs/benchmarks.md``; with ``images``, links to plots whose names begin so."""
        return bench_tables.markdown(self.document, images)

    def plots(self) -> dict[str, str]:
        """S1's figures 20 to 22 from these figures: SVG files by name."""
        return bench_tables.plots(self.document)

    def files(self) -> dict[str, str]:
        """The plots too, before the tables that link to them."""
        plots = {f"{NAME}-{name}.svg": text for name, text in self.plots().items()}
        return {f"{NAME}.json": text_of(self.document), **plots, f"{NAME}.md": self.markdown(f"{NAME}-")}


def volumetric(
    adapter: str | Gpu | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    quick: bool = False,
    settings: Settings | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
) -> Bench:
    """Measure everything that the module lists, and what ``out`` does not have yet of it.

    Args:
        adapter: part of an adapter's name; or a device to share, and then this process measures, not a child of it.
        out: folder for the rows, the figures as JSON, the tables and the plots.
        quick: :data:`QUICK` instead of S1's settings.
        settings: others than these two.
        fresh: measure again what ``out`` already has.
        progress: hears a fraction of 1 and what is being measured.

    Raises:
        GpuError: no such adapter, or one that cannot time what it draws, or nothing could be measured.
        OutputError: ``out`` cannot be written, or another run writes there.
    """
    chosen = settings or (QUICK if quick else Settings())
    if out is not None:
        check_folder(Path(out))
    features = adapter.features if isinstance(adapter, Gpu) else choose_adapter(adapter).features
    check_times(features)
    if progress:
        progress(0.0, "reading the scenes")
    planned = plan(spec(chosen))
    with tempfile.TemporaryDirectory(prefix="tyndall-") as scratch:
        workers = 0 if isinstance(adapter, Gpu) else 1
        found = sweep(planned, out or scratch, workers=workers, adapter=adapter, fresh=fresh, progress=progress)
    bench = Bench(_document(chosen, planned, {row["id"]: row for row in found.rows}), found.notes)
    if out is not None:
        bench.save(out)
    return bench


def spec(settings: Settings) -> dict[str, Any]:
    """The specification of the sweep; its parts are those of :func:`_parts`, in order."""
    common = {
        "sizes": [list(settings.size)],
        "parameters": settings.parameters(),
        "frames": settings.frames,
        "warmup": settings.warmup,
        "seconds": settings.seconds,
        "metrics": "light",
    }
    made: dict[str, Any] = json.loads(json.dumps({**common, "parts": list(_parts(settings).values())}))
    return made


def _parts(s: Settings) -> dict[str, dict[str, Any]]:
    """The parts of the sweep by name; one without scenes is left out."""
    every = [_choice(label) for label in TECHNIQUES]
    # The polygonal mesh has one vertex a texel, so its resolution is the map's. Its own error is against a march on the
    # same map; the map's error comes on top, and shows against a march on the finest map.
    maps = [{"technique": "shadow_map", "size": size} for size in s.shadow_sizes]
    march = {"judge": "march", "seconds": 4 * s.seconds}
    finest = {**march, "shadow": {"technique": "shadow_map", "size": max(s.shadow_sizes)}}
    traced = {"judge": "traced", "target": s.truth_target, "seconds": s.truth_seconds}
    small = {"sizes": [list(s.truth_size)], "truth": traced, "frames": 0, "metrics": "all"}
    converged = {"technique": "march", "steps": s.truth_steps, "jitter": 0}
    truth_maps = [{"technique": "shadow_map", "size": size} for size in s.truth_shadow_sizes]
    parts: dict[str, dict[str, Any]] = {
        "scenes": {"scenes": s.scenes, "techniques": every},
        "lights": {"scenes": ["box"] if s.lights else [], "lights": s.lights, "techniques": every},
        "froxel": {"scenes": s.error_scenes, "truth": march, "techniques": _over("froxel", "grid", s.grids)},
        "screen_space": {
            "scenes": s.error_scenes,
            "truth": march,
            "techniques": _over("screen_space", "samples", s.sample_counts),
        },
        "march": {"scenes": s.error_scenes, "truth": march, "techniques": _over("march", "steps", s.step_counts)},
        "polygonal": {"scenes": s.error_scenes, "truth": march, "techniques": "polygonal", "shadow": maps},
        "finest": {
            "scenes": s.error_scenes,
            "truth": finest,
            "techniques": "polygonal",
            "shadow": maps,
            "frames": 0,
        },
        "truth": {**small, "scenes": s.truth_scenes, "techniques": list(_JUDGED)},
        "converged": {**small, "scenes": s.truth_scenes, "techniques": converged, "shadow": truth_maps},
    }
    return {name: part for name, part in parts.items() if part["scenes"]}


def _choice(label: str) -> dict[str, Any]:
    name, _, choice = label.partition("/")
    return {"technique": name, **_CHOICES.get(choice, {})}


def _over(technique: str, parameter: str, values: Sequence[Any]) -> list[dict[str, Any]]:
    return [{"technique": technique, parameter: value} for value in values]


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


# --- rows as figures ----------------------------------------------------------------------------------------------


def _document(s: Settings, planned: Plan, rows: Rows) -> dict[str, Any]:
    """The figures by part. What could not be measured is missing from its part, and listed under ``failed``."""
    done = {id: row for id, row in rows.items() if row["status"] == "done"}
    failed = [row for row in rows.values() if row["status"] != "done"]
    if not done:
        raise GpuError(f"nothing could be measured: {failed[0]['reason']}")
    found = {
        name: [done[p.id] for p in points if p.id in done]
        for name, points in zip(_parts(s), planned.parts, strict=True)
    }
    last = max(done.values(), key=lambda row: str(row["date"]))
    document = {
        "benchmark": NAME,
        "date": last["date"].partition("T")[0],
        "adapter": last["adapter"],
        "adapter_type": last["adapter_type"],
        "driver": last["driver"],
        "versions": last["versions"],
        "settings": {
            "size": list(s.size),
            "shadow_size": s.shadow_size,
            "grid": list(s.grid),
            "samples": s.samples,
            "frames": s.frames,
            "warmup": s.warmup,
        },
        "scenes": [
            {
                "scene": row["point"]["scene"],
                "triangles": row["triangles"],
                "scene_hash": row["scene_hash"],
                "intensity": _intensity(row["point"]["scene"]),
                **_figures(row),
            }
            for row in found.get("scenes", ())
        ],
        "lights": _lights(found.get("lights", ())),
        "resolution": {name: _resolution(name, found) for name in s.error_scenes},
        "truth": {name: _truth(name, s, found) for name in s.truth_scenes},
    }
    if failed:
        names = {point.id: str(point) for point in planned.points}
        document["failed"] = [{"point": names[row["id"]], "reason": row["reason"]} for row in failed]
    return document


def _figures(row: Mapping[str, Any]) -> dict[str, Any]:
    kept = ("gpu_ms", "frame_ms", "shadow_ms", "host_ms", "passes", "memory_bytes", "shadow_bytes", "memory", "frames")
    technique = row["point"]["technique"]
    return {
        "technique": _label(technique),
        "parameters": technique,
        **{name: row[name] for name in kept if name in row},
    }


def _label(technique: Mapping[str, Any]) -> str:
    """As in :data:`TECHNIQUES`."""
    choices = [name for name, values in _CHOICES.items() if all(technique.get(k) == v for k, v in values.items())]
    return "/".join([technique["technique"], *choices])


def _intensity(scene: str) -> float:
    light = bundled.SCENES[scene]().lights[0]
    return float(light.intensity)


def _lights(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """By technique, and the lines through its time and memory."""
    by_technique: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        figures = {"lights": row["point"]["lights"], **_figures(row)}
        by_technique.setdefault(figures["technique"], []).append(figures)
    return {
        name: {
            "rows": measured,
            "time_fit": line([r["lights"] for r in measured], [r["gpu_ms"]["median"] for r in measured]),
            "memory_fit": line(
                [r["lights"] for r in measured], [r["memory_bytes"] + r["shadow_bytes"] for r in measured]
            ),
        }
        for name, measured in by_technique.items()
        if len(measured) > 1
    }


def _resolution(scene: str, found: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Error, time and memory against each technique's own resolution."""
    parameters = {"froxel": "grid", "screen_space": "samples", "march": "steps"}
    sweeps: dict[str, list[dict[str, Any]]] = {}
    rows: list[Mapping[str, Any]] = []
    for name, parameter in parameters.items():
        own = [row for row in found[name] if row["point"]["scene"] == scene]
        rows += own
        sweeps[name] = [
            {"resolution": row["point"]["technique"][parameter], **_figures(row), "error": row["errors"]["inscattered"]}
            for row in own
        ]
    finest = {
        row["point"]["shadow"]["size"]: row["errors"]["inscattered"]
        for row in found["finest"]
        if row["point"]["scene"] == scene
    }
    sweeps["polygonal"] = [
        {
            "resolution": (size := row["point"]["shadow"]["size"]),
            **_figures(row),
            "error": row["errors"]["inscattered"],
            "against_finest": finest.get(size),
        }
        for row in found["polygonal"]
        if row["point"]["scene"] == scene
    ]
    return {
        "scene_hash": rows[0]["scene_hash"] if rows else None,
        "reference": rows[0]["truth"] if rows else None,
        "sweeps": sweeps,
    }


def _truth(scene: str, s: Settings, found: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Errors against a traced truth, of the techniques and of a march that has converged."""
    rows = [row for part in ("truth", "converged") for row in found[part] if row["point"]["scene"] == scene]
    return {
        "size": list(s.truth_size),
        "truth": rows[0]["truth"] if rows else None,
        "rows": [
            {
                "technique": _label(row["point"]["technique"]),
                "parameters": row["point"]["technique"],
                "shadow": row["point"]["shadow"],
                "errors": row["errors"],
            }
            for row in rows
        ],
    }
