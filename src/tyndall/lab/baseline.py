"""The opponent of ``tyndall bench sdf``: a scene of implicit surfaces as one loop in one shader.

It is what people write on Shadertoy, and write well: the scene as literal code (:mod:`tyndall.sdf.literal`), sphere
tracing until the distance is below the pixel's cone, from the scene's box to its end; the normal by four differences;
a second march to each light, soft where the light has a size (Quilez); ambient occlusion by five distances along the
normal; the same reflection and the same lights as the frame has; a filmic curve. It reads no buffer but the lights,
writes nothing but the picture, and is compiled as the frame's own shaders are, without the driver's limits on loops.

Two of them are drawn: as a **fragment** shader over the picture, as Shadertoy runs it, and as a **compute** shader,
since data-centre GPUs have few units for fragments. A scene whose parts move cannot be literal; its moving objects are
lists that are looped over (:mod:`tyndall.sdf.listed`), written anew for each frame.

What it does not have, the frame has as well and pays for: a G-buffer that everything else can be drawn into, air,
antialiasing.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.frame import light_kinds, pack_camera, pack_lights, pack_medium
from tyndall.gpu.device import Gpu, Raster
from tyndall.gpu.params import check, param
from tyndall.gpu.resources import Bound, Closing, Resource
from tyndall.scene.model import Camera, Scene
from tyndall.sdf.listed import FEWEST, List
from tyndall.sdf.literal import Literal as Code
from tyndall.sdf.literal import literal
from tyndall.sdf.marching import Marching

OWNER = "baseline"
_MODULE = "package::lab::baseline"
_FORMAT = "rgba8unorm"
Stage = Literal["fragment", "compute"]


@dataclass(frozen=True)
class Loop:
    """What the loop is told. The defaults are those of the frame's own march.

    Attributes:
        low, high: the scene's box, where it has one.
    """

    low: tuple[float, float, float] = param((-1e9, -1e9, -1e9), doc="lower corner of all surfaces", unit="m")
    far: float = param(1e6, 0, None, "distance at which a ray ends", unit="m")
    high: tuple[float, float, float] = param((1e9, 1e9, 1e9), doc="upper corner of all surfaces", unit="m")
    spread: float = param(0.0, 0, None, "radius of a pixel's cone, per metre")
    least: float = param(1e-4, 0, None, "distance that is as good as none", unit="m")
    pace: float = param(1.0, 0, 1, "share of the distance that a step goes: 1/L")
    reach: float = param(0.5, 1e-6, None, "how far ambient occlusion looks", unit="m")
    steps: int = param(256, 1, 65536, "of a ray, at most")
    shadow_steps: int = param(96, 1, 65536, "of a ray to a light, at most")
    shadows: int = param(1, 0, 1, "whether there are any")
    occlusion: int = param(1, 0, 1, "whether there is any")
    zero: int = param(0, 0, 0, "0, which the compiler must not know")

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def of(cls, scene: Scene, size: tuple[int, int], **changes: Any) -> Loop:
        """The one that suits a scene."""
        ends = [implicit.bounds for implicit in scene.implicits]
        finite = np.array([end for end in ends if end is not None])
        low, high = (finite[:, 0].min(axis=0), finite[:, 1].max(axis=0)) if len(finite) else scene.bounds
        radius = max(float(np.linalg.norm(high - low)) / 2, 1e-3)
        away = float(np.linalg.norm(np.subtract(scene.camera.position, (low + high) / 2)))
        shapes: list[Any] = [implicit.shape for implicit in scene.implicits]
        given: dict[str, Any] = {
            "far": 4 * (away + radius) if len(finite) == len(ends) else Marching().distance,
            "spread": float(np.tan(scene.camera.fov / 2)) / size[1],
            "least": 1e-5 * radius,
            "pace": 1 / max(1.0, *(shape.lipschitz for shape in shapes)),
            "reach": scene.looks.get("field_ao", {}).get("radius", 1.0),
        }
        if len(finite) == len(ends):
            margin = 1e-3 * radius
            given |= {"low": tuple(low - margin), "high": tuple(high + margin)}
        return cls(**{**given, **changes})


class Baseline(Closing):
    """Draws a scene's implicit surfaces by a plain loop; what else is in the scene is not drawn.

    Args:
        stage: which kind of shader runs it.
        loops: numbers of the objects that are lists; None: those of at least :data:`~tyndall.sdf.listed.FEWEST`
            leaves, if ``moving``; else none.
        moving: whether leaves will be moved.
        settings: of the loop.

    Attributes:
        compile_ms: time that linking and the driver's compiler took.
        code: the scene's.

    Raises:
        ParameterError: a node that has no code, or an object that is no list.
    """

    def __init__(
        self,
        gpu: Gpu,
        scene: Scene,
        size: tuple[int, int] = (1920, 1080),
        *,
        stage: Stage = "fragment",
        loops: Collection[int] | None = None,
        moving: bool = False,
        settings: Loop | None = None,
    ) -> None:
        self.gpu, self.scene, self.size, self.stage = gpu, scene, size, stage
        if loops is None:
            loops = long_lists(scene) if moving else ()
        self.code: Code = literal(scene.implicits, loops=loops)
        self._made: list[Resource] = []
        try:
            self._scope = self._bind(settings or Loop.of(scene, size))
            begin = time.perf_counter()
            self._prepare()
            self.compile_ms = (time.perf_counter() - begin) * 1e3
        except BaseException:
            self.close()
            raise

    def _bind(self, settings: Loop) -> dict[str, Bound]:
        gpu, scene = self.gpu, self.scene
        camera, light, medium = (
            f"package::wesl::{module}::{struct}"
            for module, struct in (("camera", "Camera"), ("light", "Light"), ("medium", "Medium"))
        )
        self._camera = gpu.buffer(
            "baseline.camera", gpu.dtype(camera).itemsize, owner=OWNER, element=camera, usage="uniform"
        )
        self._made.append(self._camera)
        lights = gpu.buffer("baseline.lights", pack_lights(scene, gpu.dtype(light)), owner=OWNER, element=light)
        self._made.append(lights)
        air = gpu.buffer("baseline.medium", gpu.dtype(medium).itemsize, owner=OWNER, element=medium, usage="uniform")
        self._made.append(air)
        gpu.write(air, pack_medium(scene.medium, gpu.dtype(medium)))
        self._rows = gpu.buffer("baseline.rows", self.code.rows(), owner=OWNER, element="vec4f")
        self._made.append(self._rows)
        self._picture = gpu.texture("baseline.picture", self.size, _FORMAT, owner=OWNER, usage="sampled storage target")
        self._made.append(self._picture)
        params = gpu.params("baseline.loop", settings, owner=OWNER)
        self._made.append(params)
        told = replace(params.bound.slot, preamble=f"{params.bound.slot.preamble}\n{self.code.text}")
        self._frame(scene.camera)
        return {
            "camera": self._camera.uniform(),
            "lights": lights.read().declaring(**light_kinds(scene)),
            "medium": air.uniform(),
            "scene_rows": self._rows.read(),
            "picture_out": self._picture.write(),
            "baseline": Bound(told, params.bound.native),
        }

    def _prepare(self) -> None:
        if self.stage == "compute":
            self._pass = self.gpu.compute("baseline.compute", _MODULE, "compute").bind(self._scope).prepare()
        else:
            self._pipeline = self.gpu.raster(_MODULE, Raster(targets=((_FORMAT, None),)), self._scope)

    def _frame(self, camera: Camera) -> None:
        dtype = self.gpu.dtype("package::wesl::camera::Camera")
        self.gpu.write(self._camera, pack_camera(camera, self.scene, self.size, dtype))

    def draw(self, camera: Camera | None = None, moves: Mapping[str, ArrayLike] | None = None) -> float:
        """Record and submit one frame; returns the host's time in milliseconds.

        Args:
            camera: in place of the scene's.
            moves: of named leaves of lists.
        """
        begin = time.perf_counter()
        if camera is not None:
            self._frame(camera)
        if moves:
            self.gpu.write(self._rows, self.code.rows(moves))
        if self.stage == "compute":
            self._pass.run(-(-self.size[0] // 8), -(-self.size[1] // 8))
        else:
            pipeline, group = self._pipeline
            with self.gpu.render("baseline.fragment", [(self._picture.view(), (0.0, 0.0, 0.0, 1.0))]) as native:
                native.set_pipeline(pipeline)
                native.set_bind_group(0, group)
                native.draw(3)
        self.gpu.submit()
        return (time.perf_counter() - begin) * 1e3

    def timings(self) -> dict[str, float]:
        """GPU milliseconds of the last frame by pass name; waits for it."""
        return dict(self.gpu.timings())

    def memory(self) -> dict[str, int]:
        """Bytes on the device."""
        return {OWNER: sum(resource.size_bytes for resource in self._made)}

    def picture(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8."""
        return np.ascontiguousarray(self.gpu.read_texture(self._picture)[..., :3])

    def close(self) -> None:
        """Free what it made."""
        for resource in self._made:
            resource.destroy()
        self._made.clear()
        self.gpu.forget_groups()


def long_lists(scene: Scene) -> list[int]:
    """Numbers of the objects that are unions of very many leaves."""
    found = []
    for i, implicit in enumerate(scene.implicits):
        shape: Any = implicit.shape
        listed = List.of(shape, implicit.material)
        if listed is not None and len(listed.leaves) >= FEWEST:
            found.append(i)
    return found
