"""Rays: how long the tree takes to build, and how many rays a second it answers. Prints one JSON document.

    python benchmarks/rays.py [--size 1920x1080] [--repeat 8] [SCENE …]

Shadow rays go from what each pixel shows to the scene's first light, in tiles of 8×8 pixels as a technique traces them;
primary rays are the pixels' own; scattered rays go from the same points into random directions. ``flat`` is the same
scene as one mesh, all triangles of all instances in one tree. Times of rays are GPU times of the best of the repeats;
building is the wall clock of the second build, upload of the meshes not counted.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from typing import Any

import numpy as np
from heading import heading

import tyndall as ty
from tyndall.frame import view_matrix
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Instance, Mesh, Scene
from tyndall.tracing import bvh, cast
from tyndall.tracing.world import World


def pixel_rays(camera: Camera, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions through the pixels' centres, (N, 3) each, in tiles of 8×8."""
    width, height = size
    y, x = np.mgrid[0:height, 0:width]
    tile = np.lexsort((x.ravel() % 8, y.ravel() % 8, x.ravel() // 8, y.ravel() // 8))
    x, y = x.ravel()[tile], y.ravel()[tile]
    right, up, back = view_matrix(camera)[:3, :3]
    tangent = np.tan(camera.fov / 2)
    across = (2 * (x + 0.5) / width - 1) * tangent * width / height
    down = (1 - 2 * (y + 0.5) / height) * tangent
    way = across[:, None] * right + down[:, None] * up - back
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.broadcast_to(np.asarray(camera.position), way.shape).astype(np.float32), way.astype(np.float32)


def flattened(scene: Scene) -> Scene:
    """All triangles in one mesh, in world space."""
    positions, indices, count = [], [], 0
    for instance in scene.instances:
        matrix = np.asarray(instance.transform)
        positions.append(instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3])
        indices.append(instance.mesh.indices + count)
        count += len(instance.mesh.positions)
    mesh = Mesh(np.concatenate(positions).astype(np.float32), np.concatenate(indices).astype(np.uint32))
    return scene.with_(instances=(Instance(mesh),))


def rate(gpu: Gpu, world: World, rays: Any, entry: str, repeat: int) -> dict[str, Any]:
    module = "package::tracing::cast"
    element, name = ("package::tracing::rays::RayHit", "hits") if entry == "cast_closest" else ("u32", "answers")
    each = gpu.dtype(element).itemsize if "::" in element else 4
    with (
        gpu.buffer("bench.rays", rays, owner="bench", element=f"{module}::CastRay") as source,
        gpu.buffer("bench.out", each * len(rays), owner="bench", element=element) as out,
    ):
        best = float("inf")
        for _ in range(repeat):
            gpu.compute("rays", module, entry).bind(
                world.bindings,
                rays=source,
                ray_count=gpu.constant(len(rays)),
                cull=gpu.constant(0),
                **{name: out.read_write()},
            ).dispatch_line(len(rays))
            gpu.submit()
            best = min(best, dict(gpu.timings())["rays"])
        found = gpu.read_buffer(out)
        hit = float(np.mean(found["t"] < 1e9 if entry == "cast_closest" else found != 0))
    gpu.forget_groups()
    return {"rays": len(rays), "ms": round(best, 4), "per_second": round(len(rays) / best * 1e3), "hit": round(hit, 4)}


def passes(gpu: Gpu, world: World) -> dict[str, float]:
    """GPU milliseconds of the parts of a build."""
    sums: Counter[str] = Counter()
    submit = gpu.submit

    def submit_and_count() -> None:
        recorded = gpu.recording
        submit()
        if recorded:
            sums.update(dict(gpu.timings()))

    gpu.submit = submit_and_count  # type: ignore[method-assign]
    try:
        world.build()
    finally:
        del gpu.submit  # type: ignore[method-assign]
    return {label: round(ms, 3) for label, ms in sums.items()}


def measure(gpu: Gpu, name: str, scene: Scene, size: tuple[int, int], repeat: int) -> dict[str, Any]:
    begin = time.perf_counter()
    with World(gpu, scene) as world:
        gpu.wait()
        first = time.perf_counter() - begin
        builds = []
        for _ in range(8):
            gpu.wait()
            begin = time.perf_counter()
            world.build()
            gpu.wait()
            builds.append(time.perf_counter() - begin)
        origins, ways = pixel_rays(scene.camera, size)
        hits = cast.cast(gpu, world, origins, ways)
        there = hits["t"] < 1e9
        points = (origins + ways * (hits["t"][:, None] * (1 - 1e-4)))[there]
        light = scene.lights[0]
        if isinstance(light, DirectionalLight):
            towards, reach = -np.asarray(light.direction) / np.linalg.norm(light.direction), 1e9
            towards = np.broadcast_to(towards, points.shape)
        else:
            towards, reach = np.asarray(light.position) - points, 1.0
        scattered = np.random.default_rng(1).normal(size=points.shape)

        def pack(starts: Any, directions: Any, far: float) -> Any:
            return cast.pack_rays(gpu, starts, directions, 0.0, far)

        return {
            "scene": name,
            "triangles": scene.triangle_count,
            "in_tree": world.triangle_count,
            "depth": world.depth,
            "bytes": sum(r.size_bytes for r in world.resources()),
            "first_s": round(first, 4),
            "build_ms": round(1e3 * min(builds), 3),
            "build_all_ms": [round(1e3 * b, 2) for b in builds],
            "build_passes_ms": passes(gpu, world),
            "primary": rate(gpu, world, pack(origins, ways, 1e9), "cast_closest", repeat),
            "shadow": rate(gpu, world, pack(points, towards, reach), "cast_occluded", repeat),
            "scattered": rate(gpu, world, pack(points, scattered, 1e9), "cast_closest", repeat),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=["box", "blinds", "courtyard"])
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--repeat", type=int, default=8)
    parser.add_argument("--radius", type=int, default=bvh.RADIUS, help="of the search for neighbours, 1 to 64")
    parser.add_argument("--flat", action="store_true", help="each scene as one mesh, too")
    chosen = parser.parse_args()
    width, height = (int(side) for side in chosen.size.split("x"))
    bvh.RADIUS = chosen.radius
    scenes = {name: ty.scenes.SCENES[name]() for name in chosen.scenes}
    rows = []
    with Gpu() as gpu:
        for name, scene in scenes.items():
            rows.append(measure(gpu, name, scene, (width, height), chosen.repeat))
            if chosen.flat:
                rows.append(measure(gpu, f"{name}, flat", flattened(scene), (width, height), chosen.repeat))
        print(json.dumps({**heading("rays", gpu, scenes.values()), "rows": rows}, indent=2))


if __name__ == "__main__":
    main()
