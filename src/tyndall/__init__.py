"""Tyndall: a real-time light laboratory over WebGPU.

    >>> import tyndall as ty
    >>> ty.scenes.box(lights=3).triangle_count
    4968

This module is the whole public API on one screen. Its imports are lazy: ``import tyndall`` loads nothing heavy, and a
name loads its module when it is first used. A scene is described with :class:`Scene` and what it holds, drawn with
:func:`render`, measured with :func:`compare`, and drawn frame by frame with :class:`Renderer`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tyndall import sdf
    from tyndall.frame import Renderer
    from tyndall.gpu.device import GpuError
    from tyndall.gpu.params import ParameterError
    from tyndall.lab import bundled as scenes
    from tyndall.lab.compare import compare
    from tyndall.lab.comparison import Comparison
    from tyndall.lab.picture import Picture
    from tyndall.lab.render import render
    from tyndall.lab.sweep import Sweep, SweepError, sweep
    from tyndall.lab.truth import Truth, TruthSettings, trace
    from tyndall.scene.errors import SceneError
    from tyndall.scene.files import load, save
    from tyndall.scene.model import (
        Camera,
        DirectionalLight,
        Gibbons,
        HenyeyGreenstein,
        Image,
        Implicit,
        Instance,
        Isotropic,
        Material,
        Medium,
        Mesh,
        PointLight,
        Rayleigh,
        RectLight,
        Scene,
        Schlick,
        SpotLight,
        Texture,
        Volume,
    )
    from tyndall.scene.stage import stage
    from tyndall.techniques.antialiasing import NoAntialiasing, Taa
    from tyndall.techniques.occlusion import FieldAo, NoOcclusion, RayTracedAo
    from tyndall.techniques.reflection import FieldReflections, NoReflections
    from tyndall.techniques.shadow import (
        Blurred,
        Esm,
        Evsm,
        FieldShadows,
        Pcf,
        Pcss,
        PenumbraWedge,
        Planar,
        Projective,
        RayTraced,
        ShadowMap,
        ShadowVolume,
        Vsm,
    )
    from tyndall.techniques.tonemap import Aces, Agx, Clip
    from tyndall.techniques.volume import NoVolumes, UniformMarch
    from tyndall.techniques.volumetric import Froxel, March, Off, Polygonal, ScreenSpace

__version__ = "0.1.0"

__all__ = [
    "Aces",
    "Agx",
    "Blurred",
    "Camera",
    "Clip",
    "Comparison",
    "DirectionalLight",
    "Esm",
    "Evsm",
    "FieldAo",
    "FieldReflections",
    "FieldShadows",
    "Froxel",
    "Gibbons",
    "GpuError",
    "HenyeyGreenstein",
    "Image",
    "Implicit",
    "Instance",
    "Isotropic",
    "March",
    "Material",
    "Medium",
    "Mesh",
    "NoAntialiasing",
    "NoOcclusion",
    "NoReflections",
    "NoVolumes",
    "Off",
    "ParameterError",
    "Pcf",
    "Pcss",
    "PenumbraWedge",
    "Picture",
    "Planar",
    "PointLight",
    "Polygonal",
    "Projective",
    "RayTraced",
    "RayTracedAo",
    "Rayleigh",
    "RectLight",
    "Renderer",
    "Scene",
    "SceneError",
    "Schlick",
    "ScreenSpace",
    "ShadowMap",
    "ShadowVolume",
    "SpotLight",
    "Sweep",
    "SweepError",
    "Taa",
    "Texture",
    "Truth",
    "TruthSettings",
    "UniformMarch",
    "Volume",
    "Vsm",
    "__version__",
    "compare",
    "load",
    "render",
    "save",
    "scenes",
    "sdf",
    "stage",
    "sweep",
    "trace",
]

# Where the public names live, the light modules first.
_HOMES = (
    "tyndall.gpu.params",
    "tyndall.scene.errors",
    "tyndall.scene.model",
    "tyndall.scene.files",
    "tyndall.scene.stage",
    "tyndall.gpu.device",
    "tyndall.techniques.volumetric",
    "tyndall.techniques.shadow",
    "tyndall.techniques.occlusion",
    "tyndall.techniques.reflection",
    "tyndall.techniques.volume",
    "tyndall.techniques.antialiasing",
    "tyndall.techniques.tonemap",
    "tyndall.frame",
    "tyndall.lab.picture",
    "tyndall.lab.render",
    "tyndall.lab.truth",
    "tyndall.lab.compare",
    "tyndall.lab.sweep",
)


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'tyndall' has no attribute '{name}'")
    if name == "scenes":
        value: Any = importlib.import_module("tyndall.lab.bundled")
    elif name == "sdf":
        value = importlib.import_module("tyndall.sdf")
    else:
        modules = (importlib.import_module(home) for home in _HOMES)
        value = next(vars(module)[name] for module in modules if name in vars(module))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
