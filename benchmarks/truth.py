"""The traced reference and what else stands on rays, in figures. Prints one JSON document.

    python benchmarks/truth.py [--size 640x360] [--target 0.01] [--mitsuba VARIANT,…] [--frame 1920x1080]

- ``truth``: seconds until a traced truth of each scene has that relative standard error, the tree and the compiling of
  shaders included (``first``) and not (``warm``).
- ``mitsuba``: seconds that Mitsuba renders until its truth of the same picture is as good; start, export and compiling
  are not counted (they are beside it as ``setup``).
- ``shadows``: GPU time of ray-traced shadows for one light, hard and soft, and of ambient occlusion.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from typing import Any

from heading import heading

import tyndall as ty
from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.lab.measure import measure
from tyndall.lab.mitsuba import MitsubaError, available, judge
from tyndall.lab.truth import Truth, TruthSettings, trace
from tyndall.scene.model import DirectionalLight, Scene


def figures(truth: Truth) -> dict[str, Any]:
    return {
        "judge": truth.judge,
        "samples": truth.samples,
        "seconds": round(truth.seconds, 4),
        "error": {kind: round(truth.relative_error(kind), 6) for kind in ("radiance", "inscattered")},
        "settings": {key: str(value) for key, value in truth.settings.items()},
    }


def traced(gpu: Gpu, scene: Scene, size: tuple[int, int], settings: TruthSettings) -> dict[str, Any]:
    runs = []
    for _ in range(3):
        begin = time.perf_counter()
        truth = trace(scene, size, settings, gpu=gpu, cache=False)
        runs.append(time.perf_counter() - begin)
    return {**figures(truth), "first": round(runs[0], 4), "warm": round(min(runs[1:]), 4)}


def judged(scene: Scene, size: tuple[int, int], settings: TruthSettings, variant: str) -> dict[str, Any]:
    begin = time.perf_counter()
    try:
        truth = judge(scene, size, settings, variant=variant or None)
    except MitsubaError as error:
        return {"variant": variant, "failed": str(error)}
    return {"variant": variant, **figures(truth), "whole": round(time.perf_counter() - begin, 3)}


def softened(scene: Scene) -> Scene:
    """The same with a sun of half a degree, or lamps of 5 cm."""
    return scene.with_(
        lights=tuple(
            dataclasses.replace(light, angular_diameter=0.0093)
            if isinstance(light, DirectionalLight)
            else dataclasses.replace(light, radius=0.05)
            for light in scene.lights
        )
    )


def shadows(gpu: Gpu, scene: Scene, size: tuple[int, int], seconds: float) -> list[dict[str, Any]]:
    rows = []
    cases = [("shadow_map", scene, "none"), ("ray_traced", scene, "none"), ("ray_traced", softened(scene), "none")]
    cases.append(("ray_traced", scene, "ray_traced_ao"))
    for shadow, described, occlusion in cases:
        with Renderer(
            described, size, gpu=gpu, shadow=shadow, occlusion=occlusion, volumetric="off", antialiasing="none"
        ) as renderer:
            measured = measure(renderer, frames=100, warmup=60, budget_s=seconds)
            times = {family: t.to_json() for family, t in measured.families.items()}
            rows.append(
                {
                    "scene": scene.name,
                    "shadow": shadow,
                    "soft": described is not scene,
                    "occlusion": occlusion,
                    "gpu_ms": times.get("shadow"),
                    "occlusion_ms": times.get("occlusion"),
                    "passes": {name: round(t.median, 4) for name, t in measured.passes.items()},
                    "memory": measured.memory,
                }
            )
    return rows


def parse_size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--frame", default="1920x1080", help="for the shadows; 0x0 leaves them out")
    parser.add_argument("--target", type=float, default=0.01)
    parser.add_argument("--scenes", default="box,blinds,courtyard")
    parser.add_argument("--mitsuba", default="", help="variants, or 'best'; none if empty")
    parser.add_argument("--mitsuba-scenes", default="box")
    parser.add_argument("--seconds", type=float, default=60, help="longest time of a truth")
    parser.add_argument("--mitsuba-seconds", type=float, default=60, help="longest time of Mitsuba's")
    chosen = parser.parse_args()
    size, frame = parse_size(chosen.size), parse_size(chosen.frame)
    settings = TruthSettings(target=chosen.target, seconds=chosen.seconds)
    scenes = {name: ty.scenes.SCENES[name]() for name in chosen.scenes.split(",")}
    with Gpu() as gpu:
        found = heading("truth", gpu, scenes.values())
        found |= {"size": size, "frame": frame, "target": chosen.target}
        found["truth"] = {name: traced(gpu, scene, size, settings) for name, scene in scenes.items()}
        if min(frame) > 0:
            found["shadows"] = [row for scene in scenes.values() for row in shadows(gpu, scene, frame, 4)]
    if chosen.mitsuba:
        found["available"] = str(available())
        settings = dataclasses.replace(settings, seconds=chosen.mitsuba_seconds)
        found["mitsuba"] = {
            name: [
                judged(scenes[name], size, settings, "" if variant == "best" else variant)
                for variant in chosen.mitsuba.split(",")
            ]
            for name in chosen.mitsuba_scenes.split(",")
        }
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
