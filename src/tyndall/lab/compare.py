"""Every technique of a family on the same view: time, bytes, and error against a truth.

What is compared, and how:

- **Time and memory** are the technique's own (:mod:`tyndall.lab.measure`), in frames with everything switched on.
- **Error** is taken on linear float32 light of still frames (:mod:`tyndall.lab.metrics`): no antialiasing moves the
  camera, so equal pixels look along equal rays as the truth's. Volumetric techniques are judged by the in-scattered
  light ``L_v`` alone, so that a bright base image cannot dilute it, and shadow techniques by the light ``L_b·T`` that
  surfaces send to the eye; both also by the whole picture. Where lights have a radius, a still frame is the last of 16,
  over which a technique may gather its samples.
- **The truth** is traced, or a converged march, or Mitsuba's (:mod:`tyndall.lab.standard`). A traced one is noisy by an
  amount that it knows, and the table's errors are those that are left when its noise is taken off.
- **PSNR** in the table is that of the two final pictures, tone mapped, of the same still frames. All other figures are
  in ``results.json``.

Errors are computed in worker processes (:mod:`tyndall.lab.judging`): at once where a GPU draws and cores are free, and
after the last measurement where the processor draws, whose times they would disturb.

A technique with ``model="paper"`` follows a document whose light has its own units and is not attenuated; it is held
against the same physical truth, and its row says so. The pictures that are saved are the antialiased ones.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, fields_of, replace
from tyndall.lab import metrics, standard
from tyndall.lab.comparison import Comparison, Result
from tyndall.lab.fingerprint import scene_hash
from tyndall.lab.judging import Judges, cores
from tyndall.lab.measure import Measurement, measure
from tyndall.lab.metrics import Scores
from tyndall.lab.picture import Picture, check_folder
from tyndall.lab.stage import Overrides, Stage, Still, describe, make, values
from tyndall.lab.standard import KINDS, Standard
from tyndall.lab.truth import Truth, TruthSettings
from tyndall.scene.model import Medium, Scene
from tyndall.sdf.marching import Marching
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Technique, Unsupported

Progress = Callable[[float, str], object]
Choice = str | Technique | Sequence[str | Technique] | None

# A device that draws a frame in milliseconds never needs it; by it, a software adapter compares five techniques at
# 640×360 within a minute.
_MEASURE_BUDGET_S = 2.0
_FRAMES, _WARMUP = 64, 16
SOFT_FRAMES = 16


def compare(
    scene: Scene,
    *,
    size: tuple[int, int] = (1280, 720),
    family: str = "volumetric",
    volumetric: Choice = None,
    shadow: Choice = None,
    occlusion: str | Technique | None = None,
    reflection: str | Technique | None = None,
    volume: str | Technique | None = None,
    antialiasing: str | Technique | None = None,
    tonemap: str | Technique | None = None,
    model: str | None = None,
    parameters: Overrides | None = None,
    truth: str | Truth | None = "traced",
    truth_settings: TruthSettings | None = None,
    frames: int | None = None,
    warmup: int | None = None,
    out: str | os.PathLike[str] | None = None,
    adapter: str | Gpu | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    command: str | None = None,
) -> Comparison:
    """Light one view of a scene by several techniques of a family, and measure each.

    Args:
        size: width and height in pixels.
        family: "volumetric" or "shadow": whose techniques are compared.
        volumetric, shadow: of the compared family one or more techniques, by name or ready made, None for all of them,
            less those that refuse the scene; of the other family one, or None for its default. Shadows are compared
            without the air unless a volumetric technique is asked for: what it asks a shadow technique about points in
            the air would be its time, and not the shadow technique's.
        occlusion, reflection, volume, antialiasing, tonemap: by name or ready made; None is the family's default.
        model: "physical", "paper" or "both", for volumetric techniques that have models; None leaves each as it is.
        parameters: by technique name, parameters to change: ``{"froxel": {"grid": (190, 90, 128)}}``; by "marching",
            when rays through implicit surfaces end.
        truth: what errors are against: "traced", "march", "mitsuba", a truth that is there already, or None for no
            errors.
        truth_settings: when a traced truth is good enough; None is
            :func:`tyndall.lab.standard.default_settings`: 1 %, or what 20 s give.
        frames, warmup: frames measured, and drawn before that; None is 64 and 16, or fewer on a slow adapter.
        out: folder to save into (:meth:`~tyndall.lab.comparison.Comparison.save`).
        adapter: part of an adapter's name, or a device to share.
        seed: of everything random.
        progress: hears a fraction of 1 and what is being done.
        command: the command line that asks for this, for its record.

    Raises:
        GpuError: no such adapter, or a size beyond its limits.
        ParameterError: no such family, technique, model, parameter or truth.
        Unsupported: a technique that was asked for cannot draw this scene.
        OutputError: ``out`` cannot be written.
    """
    for name, value, least in (("frames", frames, 1), ("warmup", warmup, 0)):
        if value is not None and value < least:
            raise ParameterError(f"{name}: {value} is fewer than {least}")
    if family not in KINDS:
        raise ParameterError(f"family: '{family}' is not one of 'volumetric', 'shadow'")
    truth = None if truth == "none" else truth
    standard.check(family, truth, truth_settings)
    if out is not None:
        check_folder(Path(out))
    compared, other = (volumetric, shadow) if family == "volumetric" else (shadow, volumetric)
    fixed = "shadow" if family == "volumetric" else "volumetric"
    techniques = choose(scene, compared, model, parameters, family)
    beside = single(other, fixed, family)
    if family == "shadow" and beside in (None, "off"):
        scene, beside = scene.with_(medium=Medium()), "off"
    others = {
        fixed: beside,
        "occlusion": occlusion,
        "reflection": reflection,
        "volume": volume,
        "antialiasing": antialiasing,
        "tonemap": tonemap,
    }
    tell = _Telling(progress, len(techniques) + 3 * (truth is not None))
    with Stage(scene, size, parameters=parameters, adapter=adapter, seed=seed, **others) as stage:
        known = None
        if truth is not None:
            tell.begin("truth", 2)
            known = standard.prepare(stage, family, truth, truth_settings, progress=tell.inside)
        drawn, skipped = [], {}
        # An error on the way out ends the workers.
        with Judges(known.targets if known else {}) as judges:
            at_once = cores() > 1 and stage.gpu.adapter_info["adapter_type"] != "CPU"
            for label, technique in zip(_labels(techniques), techniques, strict=True):
                tell.begin(technique.name)
                try:
                    drawn.append(_draw(stage, label, family, technique, frames, warmup, tell))
                except Unsupported as error:
                    if compared is not None:
                        raise
                    skipped[technique.name] = str(error)
                    continue
                if known and at_once:
                    judges.submit(label, drawn[-1].light)
            if known and not at_once:
                for one in drawn:
                    judges.submit(one.label, one.light)
            if known:
                tell.begin("errors")
            judged = judges.gather(tell.inside)
        results = [_result(one, family, known, judged.get(one.label, {})) for one in drawn]
        comparison = Comparison(
            scene=scene.name,
            scene_hash=scene_hash(scene),
            triangles=scene.triangle_count,
            size=size,
            exposure=scene.camera.exposure,
            family=family,
            adapter=stage.adapter,
            driver=stage.driver,
            parameters={
                **{name: describe(stage.techniques[name]) for name in others},
                **({Marching.name: values(stage.marching)} if scene.implicits else {}),
                "frames": max((r.measurement.frames for r in results), default=0),
                "seed": seed,
            },
            results=results,
            reference=known,
            skipped=skipped,
            missing={label: reason for label, reason in judged.items() if isinstance(reason, str)},
            command=command,
        )
    if out is not None:
        tell.say(1.0, "saving")
        comparison.save(out)
    tell.say(1.0, "done")
    return comparison


def choose(
    scene: Scene, wanted: Choice, model: str | None, parameters: Overrides | None, family: str = "volumetric"
) -> list[Technique]:
    """The techniques of a comparison, ready made.

    Raises:
        ParameterError: an unknown technique, parameter or model.
    """
    if model not in (None, "physical", "paper", "both"):
        raise ParameterError(f"model: '{model}' is not one of 'physical', 'paper', 'both'")
    if isinstance(wanted, (str, Technique)):
        wanted = [wanted]
    chosen = []
    for item in FAMILIES[family].members if wanted is None else wanted:
        technique = make(family, item, scene, parameters)
        models = ("physical", "paper") if model == "both" else (model,)
        if model is None or all(f.name != "model" for f in fields_of(type(technique))):
            chosen.append(technique)
        else:
            chosen += [replace(technique, {"model": m}) for m in models]
    return chosen


def single(choice: Choice, family: str, compared: str) -> str | Technique | None:
    """The one technique of a family that is not compared.

    Raises:
        ParameterError: there are several.
    """
    if choice is None or isinstance(choice, (str, Technique)):
        return choice
    raise ParameterError(f"{family}: {len(choice)} techniques, but it is {compared} techniques that are compared here")


class _Telling:
    """Progress of a comparison, in parts of a weight each."""

    def __init__(self, progress: Progress | None, parts: int) -> None:
        self._progress, self._parts, self._begun, self._weight, self._text = progress, parts, 0, 0, ""

    def begin(self, text: str, weight: int = 1) -> None:
        self._begun += self._weight
        self._text, self._weight = text, weight
        self.inside(0.0)

    def inside(self, fraction: float) -> None:
        self.say(min(1.0, (self._begun + self._weight * fraction) / self._parts), self._text)

    def say(self, fraction: float, text: str) -> None:
        if self._progress:
            self._progress(fraction, text)


def _labels(techniques: Sequence[Technique]) -> list[str]:
    labels: list[str] = []
    counts: Counter[str] = Counter()
    for technique in techniques:
        label = technique.name + ("-paper" if getattr(technique, "model", None) == "paper" else "")
        counts[label] += 1
        labels.append(label if counts[label] == 1 else f"{label}-{counts[label]}")
    return labels


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What a technique drew, not judged yet; ``light`` by kind."""

    label: str
    technique: Technique
    measurement: Measurement
    picture: Picture
    still: Still
    light: dict[str, metrics.Light]


def _draw(
    stage: Stage,
    label: str,
    family: str,
    technique: Technique,
    frames: int | None,
    warmup: int | None,
    tell: _Telling,
) -> _Drawn:
    measurement = measure(
        stage.use(technique),
        frames=frames or _FRAMES,
        warmup=_WARMUP if warmup is None else warmup,
        budget_s=_MEASURE_BUDGET_S if frames is None else None,
        progress=tell.inside,
    )
    picture = stage.picture(technique.name)
    still = stage.still(technique, frames=SOFT_FRAMES if is_soft(stage.scene) else 1)
    light: dict[str, metrics.Light] = {kind: still.of(kind) for kind in KINDS[family]}
    return _Drawn(label, technique, measurement, picture, still, light)


def _result(drawn: _Drawn, family: str, known: Standard | None, judged: dict[str, Scores] | str) -> Result:
    technique, still = drawn.technique, drawn.still
    return Result(
        label=drawn.label,
        family=family,
        technique=technique.name,
        model=getattr(technique, "model", None),
        up_to_scale=technique.up_to_scale,
        parameters=describe(technique),
        measurement=drawn.measurement,
        scores={} if isinstance(judged, str) else judged,
        psnr=metrics.picture_psnr(still.picture.pixels, known.still) if known else None,
        picture=drawn.picture,
        still=still,
    )


def is_soft(scene: Scene) -> bool:
    """Whether a light has a size, so that its shadows are sampled."""
    return any(light.extent > 0 for light in scene.lights)
