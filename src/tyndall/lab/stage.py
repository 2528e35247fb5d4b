"""One scene on one device at one size, to be drawn by one technique after another.

Comparisons must differ in one thing only. A :class:`Stage` keeps the rest: the device with its compiled pipelines, the
scene on that device, the size, the seed, and the techniques of the other families. :meth:`Stage.still` draws the frame
that errors are measured on: no antialiasing, hence no camera jitter, so that equal pixels of two techniques, and of a
traced truth, look along equal rays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, fields_of, nearest
from tyndall.gpu.resources import Closing
from tyndall.lab.picture import Picture
from tyndall.scene.model import Scene
from tyndall.sdf.marching import Marching
from tyndall.techniques import FAMILIES
from tyndall.techniques.antialiasing import NoAntialiasing
from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow import ShadowMap
from tyndall.techniques.volumetric import March, Off

Overrides = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class Still:
    """One frame without antialiasing; all light is (H, W, 3) float32, linear.

    Attributes:
        picture: the whole frame.
        light: ``L_v``, what the air scatters towards the eye.
        surfaces: ``L_b·T``, what reaches the eye from surfaces and the background.
    """

    picture: Picture
    light: NDArray[np.float32]
    surfaces: NDArray[np.float32]

    def of(self, kind: str) -> NDArray[np.float32]:
        """Its light of a kind: "inscattered", "surfaces" or "radiance" (both)."""
        return {"inscattered": self.light, "surfaces": self.surfaces, "radiance": self.picture.radiance}[kind]


def make(family: str, chosen: str | Technique | None, scene: Scene, parameters: Overrides | None = None) -> Technique:
    """A technique of a family: ``chosen`` by name, ready made, or None for the family's default.

    One made by name starts from the scene's looks; then ``parameters`` of its name apply.

    Raises:
        ParameterError: no such technique or parameter, or no scene.
    """
    if not isinstance(scene, Scene):
        raise ParameterError(f"scene: {scene!r} is no Scene; tyndall.load reads one, tyndall.scenes has some")
    group = FAMILIES[family]
    name = chosen.name if isinstance(chosen, Technique) else chosen or group.default
    return group.make(chosen, scene.looks, (parameters or {}).get(name))


def family_of(technique: Technique) -> str:
    """The name of the family that a technique is a member of."""
    return next(f.name for f in FAMILIES.values() if type(technique) in f.members.values())


def describe(technique: Technique) -> dict[str, Any]:
    """Name and parameters of a technique, as plain data."""
    return {"technique": technique.name, **values(technique)}


def values(declared: Any) -> dict[str, Any]:
    """Every parameter by name, of anything that declares some."""
    return {f.name: getattr(declared, f.name) for f in fields_of(type(declared))}


def adapter_name(gpu: Gpu) -> str:
    """As its driver gives it."""
    return str(gpu.adapter_info["device"])


def driver_name(gpu: Gpu) -> str:
    """The driver, and the interface it is reached through."""
    info = gpu.adapter_info
    return f"{info['description']} ({info['backend_type']})".strip()


class Stage(Closing):
    """See the module.

    Args:
        adapter: part of an adapter's name, or a device to share; a shared one is left open.
        volumetric, shadow, occlusion, reflection, volume, antialiasing, tonemap: techniques by name, ready made, or
            None for the family's default; ``techniques`` has them by family.
        parameters: by technique name, parameters to change; those of "marching" are when rays through implicit surfaces
            end.

    Raises:
        GpuError: no such adapter, or a size beyond its limits.
        ParameterError: no such technique or parameter.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        *,
        volumetric: str | Technique | None = None,
        shadow: str | Technique | None = None,
        occlusion: str | Technique | None = None,
        reflection: str | Technique | None = None,
        volume: str | Technique | None = None,
        antialiasing: str | Technique | None = None,
        tonemap: str | Technique | None = None,
        parameters: Overrides | None = None,
        adapter: str | Gpu | None = None,
        seed: int = 0,
    ) -> None:
        known = [Marching.name, *(name for family in FAMILIES.values() for name in family.members)]
        for name in parameters or {}:
            if name not in known:
                raise ParameterError(f"parameters: no technique '{name}'{nearest(name, known)}")
        self.scene, self.size, self.seed = scene, size, seed
        chosen = {
            "volumetric": volumetric,
            "shadow": shadow,
            "occlusion": occlusion,
            "reflection": reflection,
            "volume": volume,
            "antialiasing": antialiasing,
            "tonemap": tonemap,
        }
        self.techniques = {family: make(family, name, scene, parameters) for family, name in chosen.items()}
        self.marching = Marching.of(scene.looks, (parameters or {}).get(Marching.name))
        self._owned = not isinstance(adapter, Gpu)
        self.gpu = adapter if isinstance(adapter, Gpu) else Gpu(adapter)
        try:
            # What cannot draw the scene is refused when it is used, not here.
            others: dict[str, Any] = {
                family: made for family, made in self.techniques.items() if family != "volumetric"
            }
            self._renderer = Renderer(
                scene, size, gpu=self.gpu, seed=seed, marching=self.marching, volumetric="off", **others
            )
        except BaseException:
            if self._owned:
                self.gpu.close()
            raise

    @property
    def adapter(self) -> str:
        """The adapter's name, as its driver gives it."""
        return adapter_name(self.gpu)

    @property
    def driver(self) -> str:
        """The driver and the interface it is reached through."""
        return driver_name(self.gpu)

    def use(self, technique: Technique, *, still: bool = False) -> Renderer:
        """The renderer with a technique in its family, the stage's own in the others, at its first frame.

        ``still`` leaves antialiasing out.

        Raises:
            Unsupported: the technique cannot draw this scene.
        """
        wanted = {**self.techniques, family_of(technique): technique}
        if still:
            wanted["antialiasing"] = NoAntialiasing()
        for family, made in wanted.items():
            # The measured one begins anew, whatever it kept; the others only where they differ.
            if made is technique or made != self._renderer.technique(family):
                self._renderer.use(family, made)
        self._renderer.restart()
        return self._renderer

    def still(self, technique: Technique, *, frames: int = 1) -> Still:
        """A frame without antialiasing: the last of ``frames``, over which a technique may gather samples."""
        renderer = self.use(technique, still=True)
        for _ in range(frames):
            renderer.draw()
        return self._still(technique.name)

    def shafts(self) -> Still:
        """The same view with sharp shadows in the air, without noise: a march through a fine shadow map."""
        return self._marched(March(steps=128, jitter=0), ShadowMap(size=2048), casters=True)

    def unshadowed(self) -> Still:
        """The same view where nothing casts a shadow."""
        return self._marched(March(steps=32, jitter=0), ShadowMap(size=16), casters=False)

    def develop(self, radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
        """(H, W, 3) linear light, as the stage's tone mapping shows it: (H, W, 3) uint8."""
        return self._renderer.develop(radiance)

    def resized(self, size: tuple[int, int]) -> Stage:
        """Another stage that differs in its size only, on the same device."""
        same: dict[str, Any] = dict(self.techniques)
        marched = {Marching.name: values(self.marching)}
        return Stage(self.scene, size, parameters=marched, adapter=self.gpu, seed=self.seed, **same)

    def unlit(self) -> Still:
        """The same view with all lights off: what shines by itself, and ambient light."""
        renderer = self.use(Off(), still=True)
        renderer.dim(0.0)
        try:
            renderer.draw()
            return self._still("unlit")
        finally:
            renderer.dim(1.0)

    def _marched(self, march: March, shadow: ShadowMap, *, casters: bool) -> Still:
        renderer = self.use(march, still=True)
        renderer.use("shadow", shadow)
        renderer.restart()
        renderer.draw(casters=casters)
        return self._still(march.name)

    def _still(self, technique: str) -> Still:
        renderer = self._renderer
        surfaces = renderer.base() * renderer.transmittance()
        return Still(self.picture(technique), renderer.inscattered(), surfaces)

    def picture(self, technique: str) -> Picture:
        """The frame drawn last."""
        made = {"scene": self.scene.name, "technique": technique, "adapter": self.adapter}
        return Picture(self._renderer.picture(), self._renderer.radiance(), self._renderer.depth(), made)

    def close(self) -> None:
        """Free everything but a device that was given."""
        self._renderer.close()
        if self._owned:
            self.gpu.close()
