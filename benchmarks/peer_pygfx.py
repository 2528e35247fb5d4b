"""pygfx on the scenes of the shadow benchmark: the time of whole frames by the clock. Prints one JSON document.

    python benchmarks/peer_pygfx.py [--size 800x600] [--cells 100000x5,10x1] [--frames 60] [--picture FILE.png]

pygfx is what a Python user would pick for lit meshes with shadows. It draws the same triangles, lights and camera into
a texture of the same size: ``MeshStandardMaterial``, a map of 1024² for each light with its own PCF of 17 taps. A frame
goes from the call of ``render`` until four bytes that were read back say that the device is done, as ours does.

What differs: pygfx shades forward, with its output in 8 bits and no tone mapping; its spot light fades from a cone
inside the outer one by another curve. Its maps draw back faces by default, which leaves out what is open: all faces are
drawn here, with a bias, as ours are. Its frame is given as it comes, the copy of the picture to the target included.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tyndall.lab.bench_shadows import Settings, counted
from tyndall.lab.measure import wall_clock
from tyndall.scene.model import DirectionalLight, Scene, SpotLight

MAP_SIZE = 1024


def described(scene: Scene) -> tuple[Any, Any]:
    """The scene and its camera as pygfx has them.

    Raises:
        ValueError: a light that it has not.
    """
    import pygfx as gfx

    made = gfx.Scene()
    background = gfx.Color(*srgb(scene.background))
    made.add(gfx.Background(None, gfx.BackgroundMaterial(background)))
    if any(scene.ambient):
        # Ours is radiance from everywhere, E = π·L; pygfx multiplies its ambient light by the albedo over π, times π.
        made.add(gfx.AmbientLight(gfx.Color(*srgb(scene.ambient)), math.pi))
    for instance in scene.instances:
        mesh = instance.mesh
        geometry = gfx.Geometry(
            indices=np.ascontiguousarray(mesh.indices, np.int32),
            positions=np.ascontiguousarray(mesh.positions),
            normals=np.ascontiguousarray(mesh.normals),
        )
        look = mesh.material
        material = gfx.MeshStandardMaterial(
            color=gfx.Color(*srgb(look.base_color[:3])), metalness=look.metallic, roughness=look.roughness
        )
        thing = gfx.Mesh(geometry, material, cast_shadow=True, receive_shadow=True)
        thing.local.matrix = np.asarray(instance.transform)
        made.add(thing)
    low, high = scene.bounds
    centre, reach = 0.5 * (low + high), float(np.linalg.norm(high - low))
    for light in scene.lights:
        made.add(_light(gfx, light, centre, reach))
    camera = gfx.PerspectiveCamera(math.degrees(scene.camera.fov), depth_range=(scene.camera.near, 10 * reach))
    camera.local.position = scene.camera.position
    camera.world.reference_up = scene.camera.up
    camera.look_at(scene.camera.target)
    return made, camera


def _light(gfx: Any, light: Any, centre: Any, reach: float) -> Any:
    color = gfx.Color(*srgb(light.color))
    if isinstance(light, SpotLight):
        lamp = gfx.SpotLight(
            color,
            light.intensity,
            cast_shadow=True,
            decay=2,
            angle=light.outer_angle,
            penumbra=1 - light.inner_angle / light.outer_angle,
        )
        lamp.local.position = light.position
        lamp.target.local.position = tuple(np.add(light.position, light.direction))
        lamp.shadow.bias = 2e-6
    elif isinstance(light, DirectionalLight):
        lamp = gfx.DirectionalLight(color, light.intensity, cast_shadow=True)
        towards = np.asarray(light.direction) / np.linalg.norm(light.direction)
        lamp.local.position = tuple(centre - reach * towards)
        lamp.target.local.position = tuple(centre)
        lamp.shadow.camera.width = lamp.shadow.camera.height = reach
        lamp.shadow.camera.depth_range = (0, 2 * reach)
        lamp.shadow.bias = 2e-3
    else:
        raise ValueError(f"{light.kind}: no such light here")
    lamp.shadow.cull_mode = "none"
    return lamp


def srgb(linear: Any) -> tuple[float, ...]:
    """Colours are linear in a scene, and in sRGB in pygfx."""
    values = np.asarray(linear, float)
    curve = np.where(values <= 0.0031308, 12.92 * values, 1.055 * np.maximum(values, 1e-9) ** (1 / 2.4) - 0.055)
    return tuple(float(v) for v in curve)


class Peer:
    """pygfx with a scene, ready to draw."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        import pygfx as gfx
        import wgpu

        self.scene, self.camera = described(scene)
        # The format that a canvas would have; usage for the picture that is looked at.
        usage = wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_SRC
        self.target = gfx.Texture(dim=2, size=(*size, 1), format="rgba8unorm", usage=usage)
        self.renderer = gfx.renderers.WgpuRenderer(self.target, pixel_ratio=1, ppaa="none")
        self.device = self.renderer.device
        self._copy_src = wgpu.BufferUsage.COPY_SRC

    def draw(self) -> None:
        """Record and submit one frame."""
        self.renderer.render(self.scene, self.camera)

    def wait(self) -> None:
        """Block until the device is done, as ours does."""
        fence = self.device.create_buffer(size=4, usage=self._copy_src)
        self.device.queue.read_buffer(fence)
        fence.destroy()

    def picture(self) -> Any:
        """(height, width, 4) uint8 of the frame drawn last."""
        return np.asarray(self.renderer.snapshot())


def measure(
    settings: Settings, *, seconds: float | None = None, progress: Callable[[str], object] = lambda text: None
) -> dict[str, Any]:
    """Whole frames of every cell; ``failed`` says why there are none."""
    try:
        import pygfx as gfx
    except Exception as fault:
        return {"failed": f"{type(fault).__name__}: {fault}"}
    cells: list[dict[str, Any]] = []
    failed: list[dict[str, Any]] = []
    adapter = ""
    for triangles, lights in settings.planned():
        where = {"triangles": triangles, "lights": lights}
        progress(f"pygfx: {triangles:,} triangles, {lights} lights")
        try:
            peer = Peer(counted(triangles, lights), settings.size)
            adapter = str(peer.device.adapter.info["device"])
            budget = seconds or settings.seconds
            times = wall_clock(
                peer.draw, peer.wait, frames=settings.frames, warmup=max(2, settings.warmup), budget_s=budget
            )
            cells.append({**where, "wall_ms": times.to_json()})
        except Exception as fault:  # the other cells are still wanted
            failed.append({**where, "reason": f"{type(fault).__name__}: {fault}".splitlines()[0]})
    found = {
        "name": "pygfx",
        "version": gfx.__version__,
        "adapter": adapter,
        "map_size": MAP_SIZE,
        "size": list(settings.size),
        "cells": cells,
    }
    return {**found, "failed_cells": failed} if failed else found


def parse_cells(text: str) -> tuple[tuple[int, int], ...]:
    """``100000x5,10x1`` as pairs of triangles and lights."""
    pairs = [cell.split("x") for cell in text.split(",")]
    return tuple((int(triangles), int(lights)) for triangles, lights in pairs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="800x600")
    parser.add_argument("--cells", help="TRIANGLESxLIGHTS,…; all of S4's if left out")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=1.0, help="the most that a cell may take")
    parser.add_argument("--picture", type=Path, help="where the last cell's picture is saved, to be looked at")
    chosen = parser.parse_args()
    width, height = (int(side) for side in chosen.size.split("x"))
    settings = Settings(
        size=(width, height),
        frames=chosen.frames,
        seconds=chosen.seconds,
        cells=parse_cells(chosen.cells) if chosen.cells else None,
    )
    print(json.dumps(measure(settings), indent=1))
    if chosen.picture:
        from PIL import Image

        peer = Peer(counted(*settings.planned()[-1]), settings.size)
        peer.draw()
        Image.fromarray(peer.picture()).save(chosen.picture)


if __name__ == "__main__":
    main()
