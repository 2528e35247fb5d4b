"""The benchmark of the shadow techniques, on the scenes of the study that this project repeats, and against truth.

``tyndall bench shadows`` measures every technique of the family, on one adapter and in one run of a few minutes:

- **cells**: S4's three tables, for all techniques: 10 to 100,000 triangles under 1 to 5 lights at 800×600, scene
  ``shadows``. GPU time of the whole frame and of the family's own passes; host time to encode and submit; the wall
  clock of a whole frame, from the first call until the device is done; memory;
- **errors**: against the traced truth, lit by a point light and by a ball of half a metre, in ``shadows`` and
  ``interior`` (where it hangs free in the room: it is larger than the lamp's shade);
- **shrink**: the error as the light shrinks to a point, of the techniques that follow its size, against the truth of
  that light and against the hard shadow;
- **resolution**: the error of what draws maps, against their size;
- **situations**: which lights, receivers and casters a technique serves
  (:mod:`tyndall.lab.shadow_situations`): the share of pixels that it gets right;
- **silhouettes**: time to find the silhouettes of a million triangles.

The frame is G-buffer, shadows, lighting, composite and tone mapping ("aces"): nothing is in the air, no ambient
occlusion, no antialiasing. A technique stands at its own defaults, and "name/choice" is another of its ways.

Pictures are held against the truth in the light ``L_b·T`` that surfaces send to the eye. Where light has no size, the
truth's visibility of it is 0 or 1 in each pixel, and is what a frame without casters, or without the light, is nearer
to. *Equal* is then the share of pixels whose light is what the frame gives for that visibility, to 1/255 of the
light's own part and the rounding of half floats; *right*, the share of those that are nearer to it than to the other.
So neither knows of what the frame and the truth see differently apart from shadows, as 8-bit albedo.

What a technique refuses is written down with its reason, and so is a fault: the others go on. With a folder, each
figure is kept at once, and a run that was stopped goes on where it was. ``quick`` measures the same things in small.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError, fields_of, nearest
from tyndall.gpu.resources import Closing
from tyndall.lab import bench_shadows_tables as tables
from tyndall.lab import metrics, standard
from tyndall.lab.bench import line
from tyndall.lab.busy import Busy
from tyndall.lab.compare import SOFT_FRAMES
from tyndall.lab.complexity import lines_of
from tyndall.lab.figures import Figures, timed_device
from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.lab.measure import Measurement, belongs, measure, wall_clock
from tyndall.lab.picture import check_folder
from tyndall.lab.shadow_situations import SITUATIONS
from tyndall.lab.stage import Stage, adapter_name, describe, driver_name
from tyndall.lab.standard import Standard
from tyndall.lab.truth import TruthSettings
from tyndall.scene import bundled
from tyndall.scene.model import DirectionalLight, PointLight, Scene, Vec3
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Technique, Unsupported

NAME = "shadows"
FAMILY = FAMILIES["shadow"]
FRAME: Mapping[str, str] = {"volumetric": "off", "occlusion": "none", "antialiasing": "none", "tonemap": "aces"}
PARTS = ("cells", "errors", "shrink", "resolution", "situations", "silhouettes")
FOLLOWS = 0.25  # of the change that the truth shows, by which a technique counts as one that follows the light's size

# Techniques that have several ways to do the same, and the parameter that chooses: each way is measured for itself. A
# technique's own name stands for its default.
_WAYS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "shadow_map": ("rasterizer", ("", "compute")),
    "shadow_volume": ("method", ("zpass", "zfail")),
}
# In metres, where the ball is in no surface and the camera still stands in the table's shadow.
_PLACES: Mapping[str, Vec3] = {"interior": (-0.8, 1.85, -0.2)}

Progress = Callable[[float, str], object]
Row = dict[str, Any]


@dataclass(frozen=True)
class Settings:
    """What is measured. The defaults are S4's settings and more; :data:`QUICK` is the same in small.

    Attributes:
        techniques: labels or names; None: all.
        cells: (triangles, lights) in place of all combinations of the two.
        sizes: of the maps, in texels.
    """

    parts: tuple[str, ...] = PARTS
    techniques: tuple[str, ...] | None = None
    size: tuple[int, int] = (800, 600)
    triangles: tuple[int, ...] = (10, 100, 1_000, 10_000, 100_000)
    lights: tuple[int, ...] = (1, 2, 3, 4, 5)
    cells: tuple[tuple[int, int], ...] | None = None
    error_size: tuple[int, int] = (640, 360)
    error_scenes: tuple[str, ...] = ("shadows", "interior")
    error_triangles: int = 10_000  # of the scene "shadows", where errors are measured
    radii: tuple[float, ...] = (0.5, 0.2, 0.1, 0.05, 0.02, 0.0)  # metres; errors are of the first and of 0
    sizes: tuple[int, ...] = (256, 512, 1024, 2048, 4096)
    situations: tuple[str, ...] = tuple(SITUATIONS)
    situation_size: tuple[int, int] = (320, 180)
    silhouettes: int = 1_000_000  # triangles
    target: float = 0.01  # relative standard error of a truth
    truth_seconds: float = 6.0  # the most that one may take
    frames: int = 40
    warmup: int = 6
    seconds: float = 0.8  # the most that one measurement may take; a GPU seldom needs it

    def planned(self) -> list[tuple[int, int]]:
        """The cells, most triangles last."""
        every = [(triangles, lights) for triangles in self.triangles for lights in self.lights]
        return sorted(self.cells) if self.cells is not None else every


QUICK = Settings(
    size=(200, 150),
    triangles=(10, 1_000),
    lights=(1, 2),
    error_size=(128, 72),
    error_scenes=("shadows",),
    error_triangles=1_000,
    radii=(0.5, 0.1, 0.0),
    sizes=(256, 1024),
    situation_size=(96, 54),
    silhouettes=20_000,
    target=0.05,
    truth_seconds=4.0,
    frames=4,
    warmup=1,
    seconds=1.0,
)


class ShadowBench(Figures):
    """The figures of one run."""

    name = NAME

    def markdown(self) -> str:
        """All tables, as they stand in ``docs/benchmarks.md``."""
        return tables.markdown(self.document)


def shadows(
    adapter: str | Gpu | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    quick: bool = False,
    settings: Settings | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
) -> ShadowBench:
    """Measure everything that the module lists, and what ``out`` does not have yet of it.

    Args:
        adapter: part of an adapter's name, or a device to share.
        out: folder for the figures as they come, the whole as JSON, and the tables.
        quick: :data:`QUICK` instead of S4's settings.
        settings: others than these two.
        fresh: measure again what ``out`` already has.
        progress: hears a fraction of 1 and what is being measured.

    Raises:
        GpuError: no such adapter, or one that cannot time what it draws.
        ParameterError: no such part or technique.
        OutputError: ``out`` cannot be written.
    """
    chosen = settings or (QUICK if quick else Settings())
    for part in chosen.parts:
        if part not in PARTS:
            raise ParameterError(f"parts: no part '{part}'{nearest(part, PARTS)} (there are {', '.join(PARTS)})")
    labels = choose(chosen.techniques)
    if out is not None:
        check_folder(Path(out))
    with timed_device(adapter) as gpu, _Desk(gpu) as desk:
        run = _Run(gpu, desk, chosen, labels, _Kept(Path(out) if out is not None else None, fresh), progress)
        document = run.document()
    reused = run.kept.reused
    notes = (f"{reused} of {reused + run.kept.made} figures were measured before",) if reused else ()
    bench = ShadowBench(document, notes)
    if out is not None:
        bench.save(out)
    return bench


def choose(wanted: Sequence[str] | None = None) -> list[str]:
    """Labels of the techniques that are measured: a name, or "name/choice" for a technique of several ways.

    Raises:
        ParameterError: no such technique.
    """
    labels = [
        label
        for name in FAMILY.members
        for label in ([f"{name}/{way}".rstrip("/") for way in _WAYS[name][1]] if name in _WAYS else [name])
    ]
    if wanted is None:
        return labels
    known = [*labels, *FAMILY.members]
    for one in wanted:
        if one not in known:
            raise ParameterError(f"techniques: no shadow technique '{one}'{nearest(one, known)}")
    whole = [one for one in wanted if one not in labels]
    return [label for label in labels if label in wanted or label.partition("/")[0] in whole]


def make(label: str, scene: Scene, **changes: Any) -> Technique:
    """The technique of a label for a scene."""
    name, _, way = label.partition("/")
    return FAMILY.make(name, scene.looks, {**({_WAYS[name][0]: way} if way else {}), **changes})


def counted(triangles: int, lights: int = 1) -> Scene:
    """S4's scene of so many triangles and lights."""
    build: Any = bundled.SCENES["shadows"]
    scene: Scene = build(triangles=triangles, lights=lights)
    return scene


def lit_by_a_ball(scene: Scene, radius: float, place: Vec3 | None = None) -> Scene:
    """The scene lit by its first light alone, as one that shines in all directions, of a radius in metres.

    Where that light is a directional one it comes from its direction, at the scene's own distance, as bright there.
    ``place`` is where the ball is put instead.
    """
    light = scene.lights[0]
    if place is not None and not isinstance(light, DirectionalLight):
        light = PointLight(place, light.intensity, light.color)
    if isinstance(light, DirectionalLight):
        low, high = scene.bounds
        reach = float(np.linalg.norm(high - low))
        towards = np.asarray(light.direction) / np.linalg.norm(light.direction)
        x, y, z = (float(v) for v in 0.5 * (low + high) - reach * towards)
        ball = PointLight((x, y, z), light.intensity * reach**2, light.color, radius)
    else:
        ball = PointLight(light.position, light.intensity, light.color, radius)
    return scene.with_(lights=(ball,))


# --- the bench ----------------------------------------------------------------------------------------------------


class _Desk(Closing):
    """One stage at a time, anew for each scene and size, and after a fault."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self._stage: Stage | None = None
        self._content = 0

    def stage(self, scene: Scene, size: tuple[int, int]) -> Stage:
        """The stage of a scene."""
        held = self._stage
        if held is None or held.scene is not scene or held.size != size:
            self.close()
            self._stage = Stage(scene, size, adapter=self.gpu, **FRAME)  # type: ignore[arg-type]
            self._content = self._held()
        assert self._stage is not None
        return self._stage

    def untouched(self, scene: Scene, size: tuple[int, int]) -> Stage:
        """The same, whose content holds nothing yet that a technique asked for, as outlines are."""
        stage = self.stage(scene, size)
        if self._held() > self._content:
            self.close()
            stage = self.stage(scene, size)
        return stage

    def memory_of(self, found: Measurement) -> int:
        """Bytes that a technique holds, and that the scene holds for it: its tree for rays, and outlines."""
        return found.bytes_of("shadow") + found.bytes_of("tracing") + found.bytes_of("mesh") - self._content

    def _held(self) -> int:
        assert self._stage is not None
        return self._stage.use(self._stage.techniques["shadow"]).memory()["mesh"]

    def close(self) -> None:
        if self._stage:
            self._stage.close()
        self._stage = None


class _Kept:
    """Figures as they were measured, by what they are of; in a folder, a line of ``shadows.jsonl`` each."""

    def __init__(self, folder: Path | None, fresh: bool) -> None:
        self._path = folder / f"{NAME}.jsonl" if folder else None
        self._rows: dict[str, Row] = {}
        self.reused = self.made = 0
        if self._path and folder:
            folder.mkdir(parents=True, exist_ok=True)
            if fresh:
                self._path.unlink(missing_ok=True)
            elif self._path.exists():
                for text in self._path.read_text(encoding="utf-8").splitlines():
                    # The last line of a run that was killed may be torn.
                    try:
                        row = json.loads(text)
                        self._rows[row["key"]] = row["row"]
                    except (ValueError, KeyError):
                        continue

    def find(self, key: str) -> Row | None:
        """What was measured before."""
        found = self._rows.get(key)
        self.reused += found is not None
        return found

    def add(self, key: str, row: Row) -> None:
        """Keep a figure."""
        self.made += 1
        if self._path:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"key": key, "row": row}, ensure_ascii=False) + "\n")


@dataclass(frozen=True, eq=False)
class _Known:
    """A truth, and the frame's own light without the light and without shadows where that has no size."""

    standard: Standard
    ends: tuple[NDArray[np.float32], NDArray[np.float32]] | None

    @property
    def target(self) -> metrics.Target:
        """The light of surfaces."""
        return self.standard.targets["surfaces"]


@dataclass
class _Run:
    """One run of the benchmark; a part is a method of its name that yields rows."""

    gpu: Gpu
    desk: _Desk
    s: Settings
    labels: list[str]
    kept: _Kept
    progress: Progress | None
    done: int = 0

    def __post_init__(self) -> None:
        self._machine = {"adapter": adapter_name(self.gpu), "driver": driver_name(self.gpu), "versions": versions()}
        self._hashes: dict[int, tuple[Scene, str]] = {}
        self._scenes: dict[str, Row] = {}
        count = len(self.labels)
        weights = {
            "cells": len(self.s.planned()) * count,
            "errors": 2 * len(self.s.error_scenes) * count,
            "shrink": len(self.s.radii) * count,
            "resolution": len(self.s.sizes) * count,
            "situations": len(self.s.situations) * count,
            "silhouettes": 2,
        }
        self._total = max(1, sum(max(0, weights[part]) for part in self.s.parts))

    def document(self) -> dict[str, Any]:
        """Every part's figures. What could not be measured is missing from its part, and listed with its reason."""
        rows = {part: list(getattr(self, f"_{part}")()) for part in PARTS if part in self.s.parts}
        self._say(1.0, "done")
        found = {part: [_public(row) for row in every if row["status"] == "done"] for part, every in rows.items()}
        missing: dict[str, list[Row]] = {"refused": [], "failed": []}
        for part, every in rows.items():
            for row in every:
                if row["status"] in missing:
                    missing[row["status"]].append({"part": part, **_public(row)})
        document = {
            "benchmark": NAME,
            "date": date.today().isoformat(),
            **self._machine,
            "adapter_type": self.gpu.adapter_info["adapter_type"],
            "settings": json.loads(json.dumps({**dataclasses.asdict(self.s), "frame": dict(FRAME)})),
            "scenes": list(self._scenes.values()),
            "techniques": {label: self._described(label) for label in self.labels},
            **found,
            **{name: every for name, every in missing.items() if every},
        }
        if "cells" in found:
            document["light_cost"] = _light_cost(found["cells"])
        return document

    def _described(self, label: str) -> Row:
        cls = FAMILY.find(label.partition("/")[0])
        made = describe(make(label, Scene()))
        return {"parameters": made, "count": len(fields_of(cls)), "lines": lines_of(cls).to_json(), "paper": cls.paper}

    # --- parts ----------------------------------------------------------------------------------------------------

    def _cells(self) -> Iterator[Row]:
        for triangles, lights in self.s.planned():
            scene = counted(triangles, lights)
            for label in self.labels:
                self._tell(f"{triangles:,} triangles, {lights} lights, {label}")
                what = {"triangles": triangles, "lights": lights, "technique": label}
                yield self._row("cells", what, scene, self.s.size, label, lambda t: self._timed(scene, t))  # noqa: B023

    def _timed(self, scene: Scene, technique: Technique) -> Row:
        stage = self.desk.untouched(scene, self.s.size)
        found = self._measured(stage, technique)
        memory = self.desk.memory_of(found)
        renderer = stage.use(technique)
        waited = wall_clock(renderer.draw, self.gpu.wait, frames=self.s.frames, budget_s=self.s.seconds)
        renderer.draw()
        passes = [label for label, _ in self.gpu.timings() if belongs(label, "shadow")]
        return {
            **_times(found),
            "wall_ms": waited.to_json(),
            "memory_bytes": memory,
            "passes": len(passes),
            "passes_ms": {name: round(t.median, 6) for name, t in found.passes.items()},
        }

    def _measured(self, stage: Stage, technique: Technique) -> Measurement:
        renderer = stage.use(technique)
        with Busy(self.gpu) as busy:
            return measure(renderer, frames=self.s.frames, warmup=self.s.warmup, budget_s=self.s.seconds, before=busy)

    def _errors(self) -> Iterator[Row]:
        for name in self.s.error_scenes:
            for radius in (self.s.radii[0], 0.0):
                yield from self._judged("errors", self._error_scene(name, radius), radius, self.labels, timed=True)

    def _error_scene(self, name: str, radius: float) -> Scene:
        scene = counted(self.s.error_triangles) if name == "shadows" else bundled.SCENES[name]()
        return lit_by_a_ball(scene, radius, _PLACES.get(name))

    def _judged(
        self, part: str, scene: Scene, radius: float, labels: Sequence[str], *, timed: bool = False
    ) -> Iterator[Row]:
        """Errors of techniques against the truth of one scene."""
        truth = self._truth(scene, self.s.error_size)
        for label in labels:
            what = {"scene": scene.name, "radius": radius, "technique": label}
            self._tell(f"{part}: {scene.name}, light of {radius:g} m, {label}")
            yield self._row(
                part, what, scene, self.s.error_size, label,
                lambda technique: self._error(technique, truth(), scene, radius, timed=timed),
            )  # fmt: skip

    def _truth(self, scene: Scene, size: tuple[int, int]) -> Callable[[], _Known]:
        """The truth of a scene, found when it is asked for first."""
        found: list[_Known] = []

        def ask() -> _Known:
            if not found:
                self._say(self.done / self._total, f"truth of {scene.name}")
                settings = TruthSettings(target=self.s.target, seconds=self.s.truth_seconds, filter="centre")
                stage = self.desk.stage(scene, size)
                known = standard.prepare(stage, "shadow", "traced", settings)
                hard = all(light.extent == 0 for light in scene.lights)
                ends = (stage.unlit().surfaces, stage.unshadowed().surfaces) if hard else None
                found.append(_Known(known, ends))
            return found[0]

        return ask

    def _error(
        self,
        technique: Technique,
        known: _Known,
        scene: Scene,
        radius: float,
        *,
        timed: bool = False,
        size: tuple[int, int] | None = None,
    ) -> Row:
        stage = self.desk.stage(scene, size or self.s.error_size)
        times = _times(self._measured(stage, technique)) if timed else {}
        still = stage.still(technique, frames=SOFT_FRAMES if radius > 0 else 1)
        return {
            **times,
            **_compared(still.surfaces, known),
            "noise": metrics.rounded(known.standard.noise["surfaces"]),
            "samples": known.standard.truth.samples,
        }

    def _shrink(self) -> Iterator[Row]:
        """Errors against the truth of each light, and against the hard shadow; ``follows`` at the largest light."""
        hard_scene = self._error_scene("shadows", 0.0)
        size, largest = self.s.error_size, self.s.radii[0]
        hard = self._truth(hard_scene, size)
        pictures: dict[str, NDArray[np.float32]] = {}

        def against(technique: Technique, scene: Scene, known: _Known, radius: float, label: str) -> Row:
            hard_light = hard().target.light
            if label not in pictures:
                pictures[label] = self.desk.stage(hard_scene, size).still(technique).surfaces
            light = pictures[label]
            if radius > 0:
                light = self.desk.stage(scene, size).still(technique, frames=SOFT_FRAMES).surfaces
            target = known.target
            found = {**_compared(light, known), "to_hard": metrics.rounded(metrics.rel_rmse(light, hard_light))}
            found["truth_to_hard"] = metrics.rounded(metrics.rel_rmse(target.light, hard_light))
            if radius == largest:
                right = metrics.rmse(target.light, hard_light)
                found["follows"] = metrics.rounded(metrics.rmse(light, pictures[label]) / right if right else 0.0)
            return found

        following = list(self.labels)
        for radius in (0.0, largest, *(r for r in self.s.radii if 0 < r < largest)):
            scene = hard_scene if radius == 0 else self._error_scene("shadows", radius)
            truth = hard if radius == 0 else self._truth(scene, size)
            for label in list(following):
                what = {"radius": radius, "technique": label}
                self._tell(f"shrink: light of {radius:g} m, {label}")
                row = self._row(
                    "shrink", what, scene, size, label,
                    lambda technique: against(technique, scene, truth(), radius, label),  # noqa: B023
                )  # fmt: skip
                if row["status"] != "done" or row.get("follows", 1.0) < FOLLOWS:
                    following.remove(label)
                yield row

    def _resolution(self) -> Iterator[Row]:
        scene = self._error_scene("shadows", 0.0)
        truth = self._truth(scene, self.s.error_size)
        for label in self.labels:
            if all(f.name != "size" for f in fields_of(FAMILY.find(label.partition("/")[0]))):
                continue
            for texels in self.s.sizes:
                self._tell(f"resolution: {label}, {texels}²")
                yield self._row(
                    "resolution", {"technique": label, "texels": texels}, scene, self.s.error_size, label,
                    lambda technique: self._error(technique, truth(), scene, 0.0, timed=True),
                    {"size": texels},
                )  # fmt: skip

    def _situations(self) -> Iterator[Row]:
        for name in self.s.situations:
            situation = SITUATIONS[name]
            scene = situation.make()
            soft = any(light.extent > 0 for light in scene.lights)
            truth = self._truth(scene, self.s.situation_size)
            for label in self.labels:
                self._tell(f"situations: {name}, {label}")
                what = {"situation": name, "kind": situation.kind, "technique": label}
                radius = 1.0 if soft else 0.0
                yield self._row(
                    "situations", what, scene, self.s.situation_size, label,
                    lambda technique: self._error(technique, truth(), scene, radius, size=self.s.situation_size),  # noqa: B023
                )  # fmt: skip

    def _silhouettes(self) -> Iterator[Row]:
        labels = [label for label in self.labels if label.partition("/")[0] == "shadow_volume"]
        scene = counted(self.s.silhouettes) if labels else Scene()
        for label in labels:
            self._tell(f"silhouettes of {self.s.silhouettes:,} triangles")
            what = {"triangles": self.s.silhouettes, "technique": label}
            yield self._row("silhouettes", what, scene, self.s.size, label, lambda t: self._extracted(scene, t))

    def _extracted(self, scene: Scene, technique: Technique) -> Row:
        found = self._measured(self.desk.stage(scene, self.s.size), technique)
        own = {name: t for name, t in found.passes.items() if name.startswith(f"shadow.{technique.name}.silhouettes")}
        if not own:
            raise GpuError(f"{technique.name} has no pass of silhouettes")
        return {**_times(found), "silhouettes_ms": round(sum(t.median for t in own.values()), 6), "steps": len(own)}

    # --- a figure -------------------------------------------------------------------------------------------------

    def _row(
        self,
        part: str,
        what: Row,
        scene: Scene,
        size: tuple[int, int],
        label: str,
        work: Callable[[Technique], Row],
        changes: Mapping[str, Any] | None = None,
    ) -> Row:
        """What ``work`` finds with a technique on a scene; or the reason why there is nothing."""
        digest = self._hash(scene)
        technique = make(label, scene, **(changes or {}))
        settings = [self.s.frames, self.s.warmup, self.s.seconds, self.s.target, self.s.truth_seconds]
        key = json.dumps([part, what, digest, size, describe(technique), settings, self._machine], sort_keys=True)
        row = self.kept.find(key)
        if row is not None:
            return row
        try:
            technique.supports(scene)
            row = {**what, "status": "done", **work(technique)}
        except Unsupported as reason:
            row = {**what, "status": "refused", "reason": str(reason)}
        except Exception as fault:  # whatever it is, the other figures are still wanted
            self.desk.close()
            said = [text.strip() for text in str(fault).splitlines() if text.strip()]
            # The first line of a driver's complaint says that there is one; the last says which.
            told = ": ".join(dict.fromkeys([type(fault).__name__, *said[:1], *said[-1:]]))
            return {**what, "status": "failed", "reason": told}
        self.kept.add(key, row)
        return row

    def _hash(self, scene: Scene) -> str:
        if id(scene) not in self._hashes:
            digest = scene_hash(scene)
            # The scene is held, for an id may be given again.
            self._hashes[id(scene)] = (scene, digest)
            self._scenes[digest] = {
                "scene": scene.name,
                "triangles": scene.triangle_count,
                "lights": len(scene.lights),
                "scene_hash": digest,
            }
        return self._hashes[id(scene)][1]

    def _tell(self, text: str) -> None:
        self._say(min(1.0, self.done / self._total), text)
        self.done += 1

    def _say(self, fraction: float, text: str) -> None:
        if self.progress:
            self.progress(min(1.0, fraction), text)


def _times(found: Measurement) -> Row:
    shadow, frame = found.technique("shadow"), found.frame
    assert shadow is not None
    assert frame is not None
    return {
        "frame_ms": frame.to_json(),
        "shadow_ms": shadow.to_json(),
        "host_ms": found.host.to_json(),
        "lighting_ms": round(found.passes["lighting"].median, 6),
        "frames": found.frames,
    }


def _compared(light: NDArray[np.float32], known: _Known) -> Row:
    """Errors against truth, and of a hard one in how many pixels there are none."""
    target = known.target
    found: dict[str, float | None] = {
        "rel_rmse": metrics.rel_rmse(light, target.light, target.error),
        "boundary": metrics.boundary(light, target),
        "bias": metrics.bias(light, target.light),
    }
    if known.ends is not None:
        equal, right = agreement(light, target.light, *known.ends)
        away = equal[~target.edges] if target.edges is not None else equal
        found["equal"], found["right"] = float(equal.mean()), float(right.mean())
        found["equal_off_edges"] = float(away.mean()) if away.size else None
    return {name: metrics.rounded(value) for name, value in found.items()}


def agreement(
    light: NDArray[np.floating[Any]],
    truth: NDArray[np.floating[Any]],
    unlit: NDArray[np.floating[Any]],
    full: NDArray[np.floating[Any]],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(equal, right) of each pixel under one light without a size, as the module says; all light is (H, W, 3).

    Args:
        unlit, full: the frame's own light where nothing of the light arrives, and where all of it does.
    """
    x, r, low, high = (np.asarray(a, np.float64) for a in (light, truth, unlit, full))
    seen = r.sum(axis=-1) > 0.5 * (low + high).sum(axis=-1)
    expected = np.where(seen[..., None], high, low)
    part = np.maximum(high - low, 0)
    rounding = 2.0**-10 * high
    off = np.abs(x - expected)
    return (off <= part / 255 + rounding).all(axis=-1), (off <= part / 2 + rounding).all(axis=-1)


def _light_cost(cells: Sequence[Row]) -> dict[str, Row]:
    """What a light costs where there are most triangles: the least-squares slope over the lights, by technique."""
    found = {}
    most = max((row["triangles"] for row in cells), default=0)
    for label in dict.fromkeys(row["technique"] for row in cells):
        rows = [row for row in cells if row["triangles"] == most and row["technique"] == label]
        if len(rows) > 1:
            counts = [row["lights"] for row in rows]
            found[label] = {
                "triangles": most,
                "shadow": line(counts, [row["shadow_ms"]["median"] for row in rows]),
                "frame": line(counts, [row["frame_ms"]["median"] for row in rows]),
            }
    return found


def _public(row: Row) -> Row:
    return {name: value for name, value in row.items() if name != "status"}
