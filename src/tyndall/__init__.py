"""Tyndall: a real-time light laboratory over WebGPU.

    >>> import tyndall as ty
    >>> scene = ty.scenes.box(lights=1)
    >>> scene.triangle_count
    4968

This module is the whole public API on one screen. Its imports are lazy: ``import tyndall`` loads nothing heavy, and a
name loads its module when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tyndall.gpu.params import ParameterError
    from tyndall.scene.model import (
        Camera,
        DirectionalLight,
        Gibbons,
        HenyeyGreenstein,
        Image,
        Instance,
        Isotropic,
        Material,
        Medium,
        Mesh,
        PointLight,
        Rayleigh,
        Scene,
        Schlick,
        SpotLight,
        Texture,
    )

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "DirectionalLight",
    "Gibbons",
    "HenyeyGreenstein",
    "Image",
    "Instance",
    "Isotropic",
    "Material",
    "Medium",
    "Mesh",
    "ParameterError",
    "PointLight",
    "Rayleigh",
    "Scene",
    "Schlick",
    "SpotLight",
    "Texture",
    "__version__",
]

# Where a public name lives, the light modules first.
_HOMES = (
    "tyndall.gpu.params",
    "tyndall.scene.model",
)


def __getattr__(name: str) -> Any:
    if name in __all__:
        for home in _HOMES:
            module = importlib.import_module(home)
            if name in vars(module):
                globals()[name] = vars(module)[name]
                return globals()[name]
    raise AttributeError(f"module 'tyndall' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
