"""Shadow maps by the hardware's rasteriser and by compute passes: how long each takes. Prints one JSON document.

    python benchmarks/rasterizer.py [--triangles 10,100000] [--lights 1,5] [--sizes 1024,2048] [--point] [SCENE …]

For each scene: GPU milliseconds of all its maps by both ways, those of each compute pass alone, the host's milliseconds
to record them, and the shares of texels that both ways cover or leave alike, and whose depths differ by less than 1 %.
Times are the medians of the repeats. Clearing the buffer is no pass: ``compute_with_clearing_ms`` is from the first
pass's beginning, so it misses it too where the driver clears first. Scenes are files; without any, ``shadows`` of every
number of triangles and lights. ``--point`` puts point lights in the lights' place, with six maps each.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
from heading import heading

import tyndall as ty
from tyndall.content.mesh import Meshes
from tyndall.content.rasterize import DepthStack, rasterize
from tyndall.gpu.device import Gpu
from tyndall.gpu.resources import Buffer, Resource
from tyndall.scene.model import PointLight, Scene
from tyndall.techniques.shadow.depth_maps import light_layers

_LAYER = "package::techniques::shadow::depth_maps::ShadowLayer"
OWNER = "bench"


def timed(gpu: Gpu, draw: Callable[[], None], repeat: int) -> tuple[dict[str, float], float]:
    """Medians of GPU milliseconds by label and of the host's milliseconds."""
    device: defaultdict[str, list[float]] = defaultdict(list)
    host = []
    for turn in range(repeat + 3):
        begin = time.perf_counter()
        draw()
        gpu.submit()
        spent = (time.perf_counter() - begin) * 1e3
        sums: defaultdict[str, float] = defaultdict(float)
        for label, milliseconds in gpu.timings():
            sums[label] += milliseconds
        if turn >= 3:  # pipelines are made, clocks are up
            host.append(spent)
            for label, milliseconds in sums.items():
                device[label].append(milliseconds)
    return {label: round(statistics.median(all_), 4) for label, all_ in device.items()}, statistics.median(host)


def measured(gpu: Gpu, scene: Scene, size: int, repeat: int) -> dict[str, Any]:
    meshes = Meshes(gpu, scene)
    layers = light_layers(scene, size)
    count = len(layers)
    rows = np.zeros(count, gpu.dtype(_LAYER))
    rows["view_proj"] = np.stack([layer.matrix.T for layer in layers])
    table = gpu.buffer("bench.layers", rows, owner=OWNER, element=_LAYER)
    maps = gpu.texture(
        "bench.maps", (size, size, count), "depth32float", owner=OWNER, dimension="2d-array", usage="sampled target"
    )
    words = gpu.buffer("bench.words", DepthStack.bytes_of(size, count), owner=OWNER)
    buffers: dict[str, Buffer] = {}
    triangles = meshes.triangles()
    assert triangles is not None

    def buffer(label: str, bytes_: int, element: str, usage: str) -> Buffer:
        if label not in buffers:
            buffers[label] = gpu.buffer(f"bench.{label}", bytes_, owner=OWNER, element=element, usage=usage)
        return buffers[label]

    def hardware() -> None:
        for index in range(count):
            scope = {"shadow_layers": table.read(), "layer": gpu.constant(index)}
            with gpu.render("hardware", depth=(maps.view(layer=index), 0.0)) as native:
                meshes.draw_depth(native, scope, "none")

    stack = DepthStack(size, count, words)

    def compute(chained: bool) -> None:
        rasterize(gpu, "compute", [triangles], table.read(), stack, "none", buffer, chained=chained)

    by_hardware, hardware_host = timed(gpu, hardware, repeat)
    by_compute, compute_host = timed(gpu, lambda: compute(True), repeat)
    passes, _ = timed(gpu, lambda: compute(False), repeat)
    raw = gpu.read_buffer(words).view(np.float32).reshape(count, stack.stride)
    same = alike = 0.0
    for index in range(count):
        theirs = gpu.read_texture(maps, layer=index)[..., 0]
        ours = raw[index, : size * size].reshape(size, size)
        same += float(((theirs > 0) == (ours > 0)).mean()) / count
        alike += float((np.abs(theirs - ours) <= 0.01 * theirs).mean()) / count
    listed = gpu.read_buffer(buffers["counts"])[:9]
    held: list[Resource] = [table, maps, words, *buffers.values()]
    for resource in held:
        resource.destroy()
    meshes.close()
    gpu.forget_groups()
    return {
        "maps": count,
        "hardware_ms": by_hardware.get("hardware"),
        "hardware_frame_ms": by_hardware.get("frame"),
        "hardware_host_ms": round(hardware_host, 4),
        "compute_ms": by_compute.get("compute"),
        "compute_host_ms": round(compute_host, 4),
        "compute_passes_ms": {k.removeprefix("compute."): v for k, v in passes.items() if k != "frame"},
        "compute_with_clearing_ms": passes.get("frame"),
        "medium_triangles": int(listed[3]),
        "large_workgroups": int(listed[7]),
        "same_coverage": round(same, 7),
        "same_depth": round(alike, 7),
    }


def with_point_lights(scene: Scene) -> Scene:
    low, high = scene.bounds
    rng = np.random.default_rng(1)
    places = low + (high - low) * rng.uniform(0.3, 0.7, (len(scene.lights), 3))
    return scene.with_(lights=tuple(PointLight(tuple(map(float, place)), 20.0) for place in places))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--triangles", default="10,100,1000,10000,100000")
    parser.add_argument("--lights", default="1,5")
    parser.add_argument("--sizes", default="1024,2048")
    parser.add_argument("--repeat", type=int, default=20)
    parser.add_argument("--point", action="store_true")
    options = parser.parse_args()

    def numbers(text: str) -> list[int]:
        return [int(part) for part in text.split(",")]

    scenes: dict[str, Scene] = {name: ty.load(name) for name in options.scenes}
    if not scenes:
        for triangles in numbers(options.triangles):
            for lights in numbers(options.lights):
                scenes[f"shadows:{triangles} × {lights}"] = ty.scenes.shadows(triangles=triangles, lights=lights)
    with Gpu() as gpu:
        rows = []
        for name, scene in scenes.items():
            seen = with_point_lights(scene) if options.point else scene
            rows += [
                {"scene": name, "size": size, **measured(gpu, seen, size, options.repeat)}
                for size in numbers(options.sizes)
            ]
        print(json.dumps({**heading("rasterizer", gpu, scenes.values()), "rows": rows}, indent=2))


if __name__ == "__main__":
    main()
