"""Every technique on the same view: time, bytes, and error against a converged reference.

What is compared, and how:

- **Time and memory** are the technique's own (:mod:`tyndall.lab.measure`), in frames with everything switched on.
- **Error** is that of the in-scattered light ``L_v`` alone, on linear float32, so that a bright base image cannot
  dilute it (:mod:`tyndall.lab.metrics`). The reference is a ray march against the same shadow maps whose steps were
  doubled until ``L_v`` changed by less than 0.1 % (:mod:`tyndall.lab.reference`), without jitter. Both are still
  frames: no antialiasing moves the camera, so equal pixels look along equal rays.
- **PSNR** is that of the two final pictures, tone mapped, of the same still frames.

A technique with ``model="paper"`` follows a document whose light has its own units and is not attenuated; it is held
against the same physical reference, and its row says so. The pictures that are saved are the antialiased ones.
"""

from __future__ import annotations

import base64
import json
import math
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, fields_of, replace
from tyndall.lab import metrics
from tyndall.lab.closeup import strip
from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.lab.measure import Measurement, measure
from tyndall.lab.picture import OutputError, Picture, encode_png
from tyndall.lab.reference import Reference, find
from tyndall.lab.stage import Overrides, Stage, Still, describe, make
from tyndall.scene.model import Scene
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Technique, Unsupported

if TYPE_CHECKING:
    from rich.table import Table

Progress = Callable[[float, str], object]

# A device that draws a frame in milliseconds never needs it; by it, a software adapter compares five techniques at
# 640×360 within a minute.
_MEASURE_BUDGET_S = 2.0
_FRAMES, _WARMUP = 64, 16


@dataclass(frozen=True)
class Error:
    """How far a technique is from the reference: see :mod:`tyndall.lab.metrics`. ``psnr`` in dB, infinite if equal."""

    rel_rmse: float
    bias: float
    psnr: float

    def to_json(self) -> dict[str, float | None]:
        """JSON has no infinity: the PSNR of equal pictures is null."""
        return {
            "rel_rmse": round(self.rel_rmse, 6),
            "psnr": round(self.psnr, 3) if math.isfinite(self.psnr) else None,
            "bias": round(self.bias, 6),
        }


@dataclass(frozen=True, eq=False)
class Result:
    """One technique's part of a comparison.

    Attributes:
        label: unique in a comparison, and the name of its files: the technique, "-paper" where its model is the
            paper's, and a number where several would be called the same.
        technique: its name.
        model: "physical" or "paper"; None for a technique that has one model only.
        parameters: all of its parameters.
        measurement: times and bytes.
        error: against the reference; None without a reference, or where the reference holds no light.
        picture: the last antialiased frame.
        still: the frame that the error was measured on.
        error_map: (H, W) relative error of ``L_v`` (:func:`tyndall.lab.metrics.error_map`); None without a reference.
    """

    label: str
    technique: str
    model: str | None
    parameters: Mapping[str, Any]
    measurement: Measurement
    error: Error | None
    picture: Picture
    still: Still
    error_map: NDArray[np.float32] | None

    @property
    def memory_bytes(self) -> int:
        """Bytes that the technique itself holds on the device."""
        return self.measurement.bytes_of("volumetric")

    def to_json(self, image: str | None) -> dict[str, Any]:
        """The entry of ``results``; ``image`` is where its picture was saved. Times are null without a GPU timer."""
        technique, frame = self.measurement.technique("volumetric"), self.measurement.frame
        return {
            "technique": self.technique,
            "model": self.model,
            "gpu_ms": technique.to_json() if technique else None,
            "frame_ms": round(frame.median, 6) if frame else None,
            "memory_bytes": self.memory_bytes,
            "error": self.error.to_json() if self.error else None,
            "image": image,
        }


@dataclass(eq=False)
class Comparison:
    """The same view by several techniques: see :func:`compare`.

    Attributes:
        scene: name of the scene.
        results: in the order asked for.
        reference: None where none was asked for.
        portrait: the reference's picture, antialiased where that was quick; else its still frame.
        skipped: why a technique that was not asked for by name took no part, by name.
        folder: where it was saved last, or None.
    """

    scene: str
    scene_hash: str
    triangles: int
    size: tuple[int, int]
    adapter: str
    driver: str
    parameters: Mapping[str, Any]
    results: list[Result]
    reference: Reference | None
    portrait: Picture | None
    skipped: Mapping[str, str] = field(default_factory=dict)
    folder: Path | None = None

    def __getitem__(self, label: str) -> Result:
        """A result by its label: ``comparison["froxel"]``, ``comparison["froxel-paper"]``."""
        for result in self.results:
            if result.label == label:
                return result
        raise KeyError(label)

    def table(self) -> Table:
        """For a terminal of 80 columns or a notebook, by rich."""
        from rich import box
        from rich.table import Table

        width, height = self.size
        title = f"{self.scene} · {self.triangles:,} triangles · {width}×{height} · {self.adapter}"
        caption = "\n".join(self._notes())
        table = Table(title=title, caption=caption, caption_justify="left", box=box.SIMPLE_HEAD, padding=0)
        table.show_edge = False
        table.add_column("technique", no_wrap=True)
        for heading in ("GPU ms\nmedian", "\nmin", "\np95", "frame\nmedian", "\nmin", "\np95"):
            table.add_column(heading, justify="right", no_wrap=True)
        for heading in ("memory\nMiB", "L_v rel\nRMSE %", "L_v\nbias %", "PSNR\ndB"):
            table.add_column(heading, justify="right", no_wrap=True)
        for result in self.results:
            technique, frame = result.measurement.technique("volumetric"), result.measurement.frame
            error = result.error
            table.add_row(
                result.label.replace("-paper", "*"),
                *(
                    _milliseconds(ms)
                    for t in (technique, frame)
                    for ms in ((t.median, t.min, t.p95) if t else 3 * [None])
                ),
                f"{result.memory_bytes / 2**20:.2f}",
                *(_scores(error) if error else "–––"),
            )
        return table

    def __str__(self) -> str:
        from rich.console import Console

        text = StringIO()
        Console(file=text, width=120).print(self.table())
        return text.getvalue().rstrip("\n")

    def _notes(self) -> list[str]:
        notes = []
        if self.reference:
            truth = self.reference
            state = "converged" if truth.within else "NOT converged"
            change = f"doubling changes L_v by {_percent(truth.change)}"
            notes.append(f"reference: {truth.technique}, {truth.steps} steps, {state} ({change})")
        if any(not result.measurement.passes for result in self.results):
            notes.append("this adapter cannot time what it draws (timestamp-query)")
        if any(result.model == "paper" for result in self.results):
            notes.append("* the paper's own units, held against the same physical reference")
        notes += [f"{name}: {reason}" for name, reason in self.skipped.items()]
        return notes

    def to_json(self) -> dict[str, Any]:
        """Plain data, ready for ``json.dumps``; ``image`` is a path once :meth:`save` was called, else null."""
        folder = self.folder
        return self._json(lambda label: str(folder / f"{label}.png") if folder else None)

    def _json(self, image: Callable[[str], str | None]) -> dict[str, Any]:
        return {
            "adapter": self.adapter,
            "scene": self.scene,
            "triangles": self.triangles,
            "size": list(self.size),
            "results": [result.to_json(image(result.label)) for result in self.results],
            "reference": self.reference.to_json() if self.reference else None,
            "versions": versions(),
            "driver": self.driver,
            "parameters": {**self.parameters, "volumetric": {r.label: dict(r.parameters) for r in self.results}},
            "scene_hash": self.scene_hash,
            **({"skipped": dict(self.skipped)} if self.skipped else {}),
        }

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write a PNG and an EXR of each technique and the reference, close-ups of each technique, ``results.json``.

        All files are made in a temporary folder beside ``folder`` first and then moved, ``results.json`` last; other
        files in an existing folder stay as they are. Paths in ``results.json`` are relative to it.

        Raises:
            OutputError: ``folder`` is a file, or the system refuses.
        """
        target = Path(folder)
        check_folder(target)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        except OSError as error:
            raise OutputError(f"{target}: {error.strerror or error}") from error
        try:
            self._write(temporary)
            target.mkdir(exist_ok=True)
            for path in sorted(temporary.iterdir(), key=lambda p: p.name == "results.json"):
                os.replace(path, target / path.name)
        except OSError as error:
            raise OutputError(f"{target}: {error.strerror or error}") from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        self.folder = target
        return target

    def _write(self, folder: Path) -> None:
        for result in self.results:
            result.picture.save(folder / f"{result.label}.png")
            result.picture.save(folder / f"{result.label}.exr")
        if self.reference and self.portrait:
            self.portrait.save(folder / "reference.png")
            self.portrait.save(folder / "reference.exr")
            still = self.reference.still.picture.pixels
            truth = f"{self.reference.technique}, {self.reference.steps} steps"
            for result in self.results:
                if result.error_map is not None:
                    score = f", rel. RMSE of L_v {_percent(result.error.rel_rmse)}" if result.error else ""
                    names = (truth, result.label + score)
                    pixels = strip(still, result.still.picture.pixels, result.error_map, names)
                    (folder / f"{result.label}-closeup.png").write_bytes(encode_png(pixels))
        document = json.dumps(self._json(lambda label: f"{label}.png"), indent=2, ensure_ascii=False)
        (folder / "results.json").write_text(document + "\n", encoding="utf-8")

    def _repr_html_(self) -> str:
        from rich.console import Console

        console = Console(record=True, file=StringIO(), width=120)
        console.print(self.table())
        table = console.export_html(inline_styles=True, code_format='<pre style="line-height:1.25">{code}</pre>')
        pictures = [(result.label, result.picture) for result in self.results]
        if self.portrait:
            pictures.append(("reference", self.portrait))
        figures = "".join(
            f'<figure style="display:inline-block;margin:4px"><img width="320" src="data:image/png;base64,'
            f'{base64.b64encode(picture._repr_png_()).decode()}"><figcaption>{label}</figcaption></figure>'
            for label, picture in pictures
        )
        return f"<div>{table}{figures}</div>"


def compare(
    scene: Scene,
    *,
    size: tuple[int, int] = (1280, 720),
    volumetric: str | Technique | Sequence[str | Technique] | None = None,
    shadow: str | Technique | None = None,
    antialiasing: str | Technique | None = None,
    tonemap: str | Technique | None = None,
    model: str | None = None,
    parameters: Overrides | None = None,
    reference: str | None = "march",
    frames: int | None = None,
    warmup: int | None = None,
    out: str | os.PathLike[str] | None = None,
    adapter: str | Gpu | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Light one view of a scene by several volumetric techniques, and measure each.

    Args:
        size: width and height in pixels.
        volumetric: one or more techniques, by name or ready made; None is all of them, less those that
            refuse the scene's lights.
        shadow, antialiasing, tonemap: by name or ready made; None is the family's default.
        model: "physical", "paper" or "both", for the techniques that have models; None leaves each as it is.
        parameters: by technique name, parameters to change: ``{"froxel": {"grid": (190, 90, 128)}}``.
        reference: the technique whose steps are doubled until it converges, or None for no errors.
        frames, warmup: frames measured, and drawn before that; None is 64 and 16, or fewer on a slow adapter.
        out: folder to save into (:meth:`Comparison.save`).
        adapter: part of an adapter's name, or a device to share.
        seed: of everything random.
        progress: hears a fraction of 1 and what is being done.

    Raises:
        GpuError: no such adapter, or a size beyond its limits.
        ParameterError: no such technique, model or parameter.
        Unsupported: a technique that was asked for cannot draw this scene.
        OutputError: ``out`` cannot be written.
    """
    for name, value, least in (("frames", frames, 1), ("warmup", warmup, 0)):
        if value is not None and value < least:
            raise ParameterError(f"{name}: {value} is fewer than {least}")
    if out is not None:
        check_folder(Path(out))
    techniques = choose(scene, volumetric, model, parameters)
    others = {"shadow": shadow, "antialiasing": antialiasing, "tonemap": tonemap}
    with Stage(scene, size, parameters=parameters, adapter=adapter, seed=seed, **others) as stage:
        tell = _Telling(progress, len(techniques) + (reference is not None))
        truth = portrait = None
        if reference is not None:
            tell.begin("reference")
            truth = find(stage, reference, progress=tell.inside)
            portrait = _portrait(stage, truth)
        results, skipped = [], {}
        for label, technique in zip(_labels(techniques), techniques, strict=True):
            tell.begin(technique.name)
            try:
                results.append(_one(stage, label, technique, truth, frames, warmup, tell))
            except Unsupported as error:
                if volumetric is not None:
                    raise
                skipped[technique.name] = str(error)
        comparison = Comparison(
            scene=scene.name,
            scene_hash=scene_hash(scene),
            triangles=scene.triangle_count,
            size=size,
            adapter=stage.adapter,
            driver=stage.driver,
            parameters={
                **{family: describe(getattr(stage, family)) for family in others},
                "frames": max((r.measurement.frames for r in results), default=0),
                "seed": seed,
            },
            results=results,
            reference=truth,
            portrait=portrait,
            skipped=skipped,
        )
    if out is not None:
        tell.say(1.0, "saving")
        comparison.save(out)
    tell.say(1.0, "done")
    return comparison


def choose(
    scene: Scene,
    volumetric: str | Technique | Sequence[str | Technique] | None,
    model: str | None,
    parameters: Overrides | None,
) -> list[Technique]:
    """The volumetric techniques of a comparison, ready made.

    Raises:
        ParameterError: an unknown technique, parameter or model.
    """
    if model not in (None, "physical", "paper", "both"):
        raise ParameterError(f"model: '{model}' is not one of 'physical', 'paper', 'both'")
    if isinstance(volumetric, (str, Technique)):
        volumetric = [volumetric]
    wanted = FAMILIES["volumetric"].members if volumetric is None else volumetric
    chosen = []
    for item in wanted:
        technique = make("volumetric", item, scene, parameters)
        models = ("physical", "paper") if model == "both" else (model,)
        if model is None or all(f.name != "model" for f in fields_of(type(technique))):
            chosen.append(technique)
        else:
            chosen += [replace(technique, {"model": m}) for m in models]
    return chosen


def check_folder(folder: Path) -> None:
    """Raises OutputError where a folder of results cannot be made: before any work is done."""
    for path in (folder, *folder.parents):
        if path.is_dir():
            if not os.access(path, os.W_OK):
                raise OutputError(f"{folder}: {path} is not writable")
            return
        if path.exists():
            raise OutputError(f"{folder}: {path} is a file, not a folder")


class _Telling:
    """Progress of a comparison: parts of equal weight."""

    def __init__(self, progress: Progress | None, parts: int) -> None:
        self._progress, self._parts, self._begun, self._text = progress, parts, 0, ""

    def begin(self, text: str) -> None:
        self._begun += 1
        self._text = text
        self.inside(0.0)

    def inside(self, fraction: float) -> None:
        self.say((self._begun - 1 + fraction) / self._parts, self._text)

    def say(self, fraction: float, text: str) -> None:
        if self._progress:
            self._progress(fraction, text)


def _portrait(stage: Stage, truth: Reference, seconds: float = 8.0) -> Picture:
    """The reference as it is saved: antialiased like the techniques where that takes no longer than ``seconds``."""
    if 16 * truth.seconds > seconds:
        return truth.still.picture
    renderer = stage.use(truth.made)
    for _ in range(16):
        renderer.draw()
    return stage.picture(truth.technique)


def _labels(techniques: Sequence[Technique]) -> list[str]:
    labels: list[str] = []
    counts: Counter[str] = Counter()
    for technique in techniques:
        label = technique.name + ("-paper" if getattr(technique, "model", None) == "paper" else "")
        counts[label] += 1
        labels.append(label if counts[label] == 1 else f"{label}-{counts[label]}")
    return labels


def _one(
    stage: Stage,
    label: str,
    technique: Technique,
    truth: Reference | None,
    frames: int | None,
    warmup: int | None,
    tell: _Telling,
) -> Result:
    measurement = measure(
        stage.use(technique),
        frames=frames or _FRAMES,
        warmup=_WARMUP if warmup is None else warmup,
        budget_s=_MEASURE_BUDGET_S if frames is None else None,
        progress=tell.inside,
    )
    picture = stage.picture(technique.name)
    still = stage.still(technique)
    error = None
    error_map = None
    if truth is not None:
        reference = truth.still
        rel_rmse = metrics.rel_rmse(still.light, reference.light)
        bias = metrics.bias(still.light, reference.light)
        error_map = metrics.error_map(still.light, reference.light)
        if rel_rmse is not None and bias is not None:
            error = Error(rel_rmse, bias, metrics.picture_psnr(still.picture.pixels, reference.picture.pixels))
    return Result(
        label=label,
        technique=technique.name,
        model=getattr(technique, "model", None),
        parameters=describe(technique),
        measurement=measurement,
        error=error,
        picture=picture,
        still=still,
        error_map=error_map,
    )


def _milliseconds(ms: float | None) -> str:
    """Three significant digits, which is what a timer gives; a dash where there is no timer."""
    if ms is None:
        return "–"
    return f"{ms:.3f}" if ms < 1 else f"{ms:.2f}" if ms < 10 else f"{ms:.1f}" if ms < 100 else f"{ms:.0f}"


def _scores(error: Error) -> tuple[str, str, str]:
    return f"{100 * error.rel_rmse:.2f}", f"{100 * error.bias:+.2f}", f"{error.psnr:.1f}"


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2f} %"
