"""One picture of a scene."""

from __future__ import annotations

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab.picture import Picture
from tyndall.lab.stage import Overrides, Stage, make
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Technique


def render(
    scene: Scene,
    *,
    size: tuple[int, int] = (1280, 720),
    volumetric: str | Technique = "froxel",
    shadow: str | Technique | None = None,
    occlusion: str | Technique | None = None,
    reflection: str | Technique | None = None,
    volume: str | Technique | None = None,
    antialiasing: str | Technique | None = None,
    tonemap: str | Technique | None = None,
    parameters: Overrides | None = None,
    frames: int = 16,
    adapter: str | Gpu | None = None,
    seed: int = 0,
) -> Picture:
    """Draw a scene and return its last frame.

    Args:
        size: width and height in pixels.
        volumetric, shadow, occlusion, reflection, volume, antialiasing, tonemap: a technique of each family, by name or
            ready made; None is the family's default. One made by name starts from the scene's looks.
        parameters: by technique name, parameters to change: ``{"froxel": {"grid": (190, 90, 128)}}``; by "marching",
            when rays through implicit surfaces end.
        frames: how many frames are drawn; temporal antialiasing gathers its samples from them.
        adapter: part of an adapter's name, or a device to share.
        seed: of everything random.

    Raises:
        GpuError: no such adapter, or a size beyond its limits.
        ParameterError: no such technique or parameter, or a size or number of frames below 1.
    """
    if frames < 1:
        raise ParameterError(f"frames: {frames} is fewer than 1")
    others = {
        "shadow": shadow,
        "occlusion": occlusion,
        "reflection": reflection,
        "volume": volume,
        "antialiasing": antialiasing,
        "tonemap": tonemap,
    }
    with Stage(scene, size, parameters=parameters, adapter=adapter, seed=seed, **others) as stage:
        technique = make("volumetric", volumetric, scene, parameters)
        renderer = stage.use(technique)
        for _ in range(frames):
            renderer.draw()
            stage.gpu.wait()  # an interrupt takes effect after one frame, not after all that are in flight
        return stage.picture(technique.name)
