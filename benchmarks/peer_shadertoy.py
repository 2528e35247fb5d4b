"""The package wgpu-shadertoy on an implicit scene: the time of whole frames by the clock. Prints one JSON document.

    python benchmarks/peer_shadertoy.py [--scene NAME] [--size 1920x1080] [--seconds 5] [--picture FILE.png]

wgpu-shadertoy runs shaders of shadertoy.com, and WGSL after the same rules: one function from a pixel to its colour,
in a fragment shader. It gets the plain loop of :mod:`tyndall.lab.baseline`, with the camera, the lights and the
settings as constants in its text, as nothing can be bound. It compiles with wgpu's own limits on loops, which
Tyndall's shaders do without.

Its release 0.2.0 asks for windows that wgpu no longer has ("No module named 'wgpu.gui'" with wgpu 0.32): two modules of
that name, with a canvas that only holds a texture, are put in its way. It never opens a window or a connection here:
``requests``, which it imports for shadertoy.com, is stood in for where it is not installed.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import re
import subprocess
import sys
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tyndall.frame import light_kinds, pack_camera, pack_lights, pack_medium
from tyndall.gpu.params import fields_of, struct_wesl
from tyndall.gpu.shader import Linker
from tyndall.lab.baseline import Loop
from tyndall.lab.measure import wall_clock
from tyndall.scene.model import Scene
from tyndall.sdf.literal import literal, number

_SHADER = """
fn shader_main(frag_coord: vec2<f32>) -> vec4<f32> {
    BASELINE.zero = min(0, i32(i_frame));
    return picture_at(vec2f(frag_coord.x, i_resolution.y - frag_coord.y));
}
"""


def shader(scene: Scene, size: tuple[int, int], settings: Loop | None = None) -> str:
    """WGSL after wgpu-shadertoy's rules."""
    linker = Linker.of_package()
    structs = {
        "camera": ("package::wesl::camera::Camera", pack_camera),
        "lights": ("package::wesl::light::Light", pack_lights),
        "medium": ("package::wesl::medium::Medium", pack_medium),
    }
    dtypes = {name: linker.dtype(path) for name, (path, _) in structs.items()}
    camera = pack_camera(scene.camera, scene, size, dtypes["camera"])
    lights = pack_lights(scene, dtypes["lights"])
    medium = pack_medium(scene.medium, dtypes["medium"])
    chosen = settings or Loop.of(scene, size)
    loop = ", ".join(_value(getattr(chosen, f.name)) for f in fields_of(Loop))
    rows = ", ".join(_struct("Light", row) for row in lights)
    code = literal(scene.implicits).text
    imports = [line for line in code.splitlines() if line.startswith("import")]
    rest = [line for line in code.splitlines() if not line.startswith("import")]
    bindings = "\n".join(
        [
            *(f"import {path};" for path, _ in structs.values()),
            *imports,
            struct_wesl(Loop, "LoopParams"),
            *(f"const {name} = {str(value).lower()};" for name, value in light_kinds(scene).items()),
            f"var<private> baseline: LoopParams = LoopParams({loop});",
            f"const camera = {_struct('Camera', camera)};",
            f"const medium = {_struct('Medium', medium)};",
            f"var<private> lights: array<Light, {len(lights)}> = array<Light, {len(lights)}>({rows});",
            *rest,
        ]
    )
    linked = linker.link("package::lab::baseline", ("picture_at",), bindings, {}, {})
    name = re.findall(r"var<private> (\w*baseline)\b", linked.wgsl)[0]
    return linked.wgsl + _SHADER.replace("BASELINE", name)


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return f"vec{len(value)}f({', '.join(number(float(v)) for v in value)})"
    return str(value) if isinstance(value, int) else number(float(value))


def _struct(name: str, row: Any) -> str:
    """A struct's constructor from its numpy row."""
    parts = []
    for field in row.dtype.names:
        if field.startswith(("_", "pad")):
            continue
        values = np.asarray(row[field])
        kind = "u" if values.dtype.kind == "u" else "f"
        texts = [f"{int(v)}u" if kind == "u" else number(float(v)) for v in values.ravel()]
        if values.shape == ():
            parts.append(texts[0])
        elif values.shape == (4, 4):
            parts.append(f"mat4x4f({', '.join(texts)})")
        else:
            parts.append(f"vec{len(texts)}{kind}({', '.join(texts)})")
    return f"{name}({', '.join(parts)})"


# --- the package ----------------------------------------------------------------------------------------------------


class _Canvas:
    """What wgpu-shadertoy needs of a window: a texture to draw into."""

    def __init__(self, *, size: tuple[float, float], **_: Any) -> None:
        self.size = tuple(int(side) for side in size)
        self._function: Any = None
        self._texture: Any = None

    def get_context(self) -> Any:
        return self

    def get_preferred_format(self, adapter: Any) -> str:
        return "rgba8unorm-srgb"

    def configure(self, *, device: Any, format: str) -> None:
        import wgpu

        usage = wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.COPY_SRC
        self._device = device
        self._texture = device.create_texture(size=(*self.size, 1), format=format, usage=usage)

    def get_current_texture(self) -> Any:
        return self._texture

    def add_event_handler(self, *_: Any) -> None:
        pass

    def request_draw(self, function: Any = None) -> None:
        self._function = function or self._function

    def draw(self) -> None:
        self._function()

    def read(self) -> Any:
        width, height = self.size
        raw = self._device.queue.read_texture(
            {"texture": self._texture}, {"bytes_per_row": 4 * width, "rows_per_image": height}, (width, height, 1)
        )
        return np.frombuffer(raw, np.uint8).reshape(height, width, 4)


def _stand_in() -> None:
    """Put the modules in its way that its release asks for and that are gone."""
    import wgpu.utils  # noqa: F401

    if "wgpu.gui" not in sys.modules and importlib.util.find_spec("wgpu.gui") is None:
        for name in ("wgpu.gui", "wgpu.gui.auto", "wgpu.gui.offscreen"):
            module: Any = types.ModuleType(name)
            module.WgpuCanvas, module.run = _Canvas, lambda: None
            sys.modules[name] = module
    if "requests" not in sys.modules and importlib.util.find_spec("requests") is None:
        sys.modules["requests"] = types.ModuleType("requests")


class Peer:
    """wgpu-shadertoy with a scene, ready to draw."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        _stand_in()
        from wgpu_shadertoy import Shadertoy

        self._toy: Any = Shadertoy(shader(scene, size), resolution=size, shader_type="wgsl", offscreen=True)
        self.device = self._toy._device

    def draw(self) -> None:
        """Record and submit one frame."""
        self._toy.snapshot()

    def wait(self) -> None:
        """Block until the device is done, as ours does."""
        import wgpu

        fence = self.device.create_buffer(size=4, usage=wgpu.BufferUsage.COPY_SRC)
        self.device.queue.read_buffer(fence)
        fence.destroy()

    def picture(self) -> Any:
        """(height, width, 4) uint8 of the frame drawn last."""
        return self._toy._canvas.read()


def measure(
    scenes: dict[str, Scene],
    size: tuple[int, int],
    *,
    seconds: float = 5.0,
    progress: Callable[[str], object] = lambda text: None,
) -> dict[str, Any]:
    """Whole frames of every scene; ``failed`` says why there are none."""
    try:
        _stand_in()
        import wgpu_shadertoy  # noqa: F401

        version = importlib.metadata.version("wgpu-shadertoy")
    except Exception as fault:
        return {"name": "wgpu-shadertoy", "failed": f"{type(fault).__name__}: {fault}"}
    rows: list[dict[str, Any]] = []
    failed: list[dict[str, Any]] = []
    adapter = ""
    for name, scene in scenes.items():
        progress(f"wgpu-shadertoy: {name}")
        try:
            peer = Peer(scene, size)
            adapter = str(peer.device.adapter.info["device"])
            times = wall_clock(peer.draw, peer.wait, frames=10_000, warmup=3, budget_s=seconds)
            rows.append({"scene": name, "wall_ms": times.to_json()})
        except Exception as fault:  # the other scenes are still wanted
            failed.append({"scene": name, "reason": f"{type(fault).__name__}: {fault}".splitlines()[0]})
    found = {"name": "wgpu-shadertoy", "version": version, "adapter": adapter, "size": list(size), "scenes": rows}
    return {**found, "failed_scenes": failed} if failed else found


def measure_apart(
    names: Sequence[str],
    size: tuple[int, int],
    *,
    seconds: float = 5.0,
    timeout: float = 90.0,
    progress: Callable[[str], object] = lambda text: None,
) -> dict[str, Any]:
    """As :func:`measure`, each scene in a process of its own, which is ended after a time: the package makes its
    pipeline anew for every frame, and a driver may compile it as often.
    """
    found: dict[str, Any] = {"name": "wgpu-shadertoy", "scenes": [], "failed_scenes": []}
    for name in names:
        progress(f"wgpu-shadertoy: {name}")
        words = [sys.executable, __file__, "--scene", name, "--size", "{}x{}".format(*size), "--seconds", str(seconds)]
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=timeout, check=False)
            part = json.loads(done.stdout)
        except subprocess.TimeoutExpired:
            found["failed_scenes"].append({"scene": name, "reason": f"not done within {timeout:g} s"})
            continue
        except ValueError:
            said = done.stderr.strip().splitlines()
            found["failed_scenes"].append({"scene": name, "reason": said[-1] if said else f"exit {done.returncode}"})
            continue
        if "failed" in part:
            return part
        for key in ("scenes", "failed_scenes"):
            found[key] += part.pop(key, [])
        found |= part
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="portrait")
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--seconds", type=float, default=5.0, help="of measuring")
    parser.add_argument("--picture", type=Path, help="where the picture is saved, to be looked at")
    chosen = parser.parse_args()
    from tyndall.lab.scenes import open_scene

    width, height = (int(side) for side in chosen.size.split("x"))
    scene = open_scene(chosen.scene)
    print(json.dumps(measure({chosen.scene: scene}, (width, height), seconds=chosen.seconds), indent=1))
    if chosen.picture:
        from PIL import Image

        peer = Peer(scene, (width, height))
        peer.draw()
        Image.fromarray(peer.picture()).save(chosen.picture)


if __name__ == "__main__":
    main()
