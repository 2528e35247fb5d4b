"""One scene on one device at one size, to be drawn by one technique after another.

Comparisons must differ in one thing only. A :class:`Stage` keeps the rest: the device with its compiled pipelines, the
scene on that device, the size, the seed, and the techniques of the other families. :meth:`Stage.still` draws the one
frame that errors are measured on: no antialiasing, hence no camera jitter, so that equal pixels of two techniques look
along equal rays.
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
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Technique

Overrides = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Still:
    """One frame without antialiasing. ``light`` is ``L_v``, (H, W, 3) float32 linear."""

    picture: Picture
    light: NDArray[np.float32]


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


def describe(technique: Technique) -> dict[str, Any]:
    """Name and parameters of a technique, as plain data."""
    values = {f.name: getattr(technique, f.name) for f in fields_of(type(technique))}
    return {"technique": technique.name, **values}


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
        shadow, occlusion, antialiasing, tonemap: techniques by name, ready made, or None for the family's default.

    Raises:
        GpuError: no such adapter, or a size beyond its limits.
        ParameterError: no such technique or parameter.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        *,
        shadow: str | Technique | None = None,
        occlusion: str | Technique | None = None,
        antialiasing: str | Technique | None = None,
        tonemap: str | Technique | None = None,
        parameters: Overrides | None = None,
        adapter: str | Gpu | None = None,
        seed: int = 0,
    ) -> None:
        known = [name for family in FAMILIES.values() for name in family.members]
        for name in parameters or {}:
            if name not in known:
                raise ParameterError(f"parameters: no technique '{name}'{nearest(name, known)}")
        self.scene, self.size, self.seed = scene, size, seed
        self.shadow = make("shadow", shadow, scene, parameters)
        self.occlusion = make("occlusion", occlusion, scene, parameters)
        self.antialiasing = make("antialiasing", antialiasing, scene, parameters)
        self.tonemap = make("tonemap", tonemap, scene, parameters)
        self._owned = not isinstance(adapter, Gpu)
        self.gpu = adapter if isinstance(adapter, Gpu) else Gpu(adapter)
        try:
            self._renderer = Renderer(
                scene,
                size,
                gpu=self.gpu,
                volumetric="off",
                shadow=self.shadow,
                occlusion=self.occlusion,
                antialiasing=self.antialiasing,
                tonemap=self.tonemap,
                seed=seed,
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

    def use(self, volumetric: Technique, *, still: bool = False) -> Renderer:
        """The renderer with a volumetric technique, at its first frame; ``still`` leaves antialiasing out.

        Raises:
            Unsupported: the technique cannot draw this scene.
        """
        self._renderer.use("volumetric", volumetric)
        self._renderer.use("antialiasing", "none" if still else self.antialiasing)
        self._renderer.restart()
        return self._renderer

    def still(self, volumetric: Technique) -> Still:
        """One frame without antialiasing."""
        renderer = self.use(volumetric, still=True)
        renderer.draw()
        return Still(self.picture(volumetric.name), renderer.inscattered())

    def resized(self, size: tuple[int, int]) -> Stage:
        """Another stage that differs in its size only, on the same device."""
        return Stage(
            self.scene,
            size,
            shadow=self.shadow,
            occlusion=self.occlusion,
            antialiasing=self.antialiasing,
            tonemap=self.tonemap,
            adapter=self.gpu,
            seed=self.seed,
        )

    def picture(self, technique: str) -> Picture:
        """The frame drawn last."""
        made = {"scene": self.scene.name, "technique": technique, "adapter": self.adapter}
        return Picture(self._renderer.picture(), self._renderer.radiance(), self._renderer.depth(), made)

    def close(self) -> None:
        """Free everything but a device that was given."""
        self._renderer.close()
        if self._owned:
            self.gpu.close()
