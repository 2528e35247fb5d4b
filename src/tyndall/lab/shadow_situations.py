"""Small scenes that ask one question each of a shadow technique: which lights, receivers and casters does it serve?

All have a floor, a wall behind it, and a closed caster above; each differs from the first, ``directional``, in what
its name says. Lights have no size but the rectangle's, so that the truth is a hard shadow and every pixel is right or
wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tyndall.scene import model
from tyndall.scene.bundled.primitives import Geometry, ball, cuboid, flat, lathe, rotation, sheet, translation, tube
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Image,
    Instance,
    Light,
    Material,
    PointLight,
    Scene,
    SpotLight,
    Texture,
)

_PLASTER = Material("plaster", base_color=(0.75, 0.72, 0.68, 1), roughness=0.9)
_CLAY = Material("clay", base_color=(0.72, 0.4, 0.26, 1), roughness=0.7)
_SLATE = Material("slate", base_color=(0.35, 0.42, 0.5, 1), roughness=0.8)

_CAMERA = Camera((3.0, 2.6, 4.4), (-0.25, 0.75, -0.35), fov=math.radians(25), near=0.05)
_SUN = DirectionalLight((-0.55, -1.0, -0.5), 4.0)
_LAMP = (1.6, 3.2, 1.9)


@dataclass(frozen=True)
class Situation:
    """A question: what is asked (``kind``: "lights", "receivers" or "casters"), in words, and how the scene is made."""

    kind: str
    words: str
    make: Callable[[], Scene]


def _floor() -> Geometry:
    return flat([(-4, 0, 4), (4, 0, 4), (4, 0, -2), (-4, 0, -2)], (0, 1, 0))


def _wall() -> Geometry:
    return flat([(-4, 0, -2), (4, 0, -2), (4, 4, -2), (-4, 4, -2)], (0, 0, 1))


def _beam() -> Geometry:
    """A closed caster with flat faces."""
    return cuboid((-0.6, -0.12, -0.25), (0.6, 0.12, 0.25)).placed(
        translation(0.1, 1.35, -0.2) @ rotation("y", 0.6) @ rotation("z", 0.35)
    )


def _ring() -> Geometry:
    """A closed ring that shades itself."""
    angle = np.arange(48) * (2 * math.pi / 48)
    path = np.stack([0.62 * np.cos(angle), 0.62 * np.sin(angle), 0 * angle], 1)
    return tube(path, 0.17, 20, closed=True).placed(
        translation(0.0, 0.95, 0.1) @ rotation("y", -0.35) @ rotation("x", 0.5)
    )


def _scene(name: str, parts: Mapping[str, tuple[Geometry, Material]], light: Light, camera: Camera = _CAMERA) -> Scene:
    room = {"floor": (_floor(), _PLASTER), "wall": (_wall(), _PLASTER)}
    instances = [Instance(part.mesh(look, what), name=what) for what, (part, look) in {**room, **parts}.items()]
    return Scene(tuple(instances), (light,), camera, ambient=(0.08, 0.08, 0.09), name=name)


def _lit_by(name: str, light: Light) -> Situation:
    return Situation("lights", name, lambda: _scene(name, {"beam": (_beam(), _CLAY)}, light))


def _curved() -> Scene:
    jar = lathe([(0, 0), (0.45, 0.05), (0.75, 0.45), (0.7, 0.8), (0.35, 1.1), (0, 1.15)], 40, crease=math.pi)
    sphere = ball(0.22, 32, 16).at(0.55, 1.75, 0.45)
    return _scene("curved", {"jar": (jar, _SLATE), "sphere": (sphere, _CLAY)}, _SUN)


def _itself() -> Scene:
    return _scene("itself", {"ring": (_ring(), _CLAY)}, _SUN)


def _shaded_eye() -> Scene:
    """The camera stands under a board, in its shadow volume."""
    board = cuboid((-1.5, 0, -1.5), (1.5, 0.1, 1.5)).at(3.6, 3.2, 4.9)
    return _scene("inside", {"beam": (_beam(), _CLAY), "board": (board, _SLATE)}, _SUN)


def _sail() -> Scene:
    """A bent sheet without a thickness."""
    s, t = np.meshgrid(np.linspace(-1, 1, 13), np.linspace(-1, 1, 9))
    points = np.stack([0.75 * s, 1.35 + 0.25 * s**2 + 0.3 * t, 0.45 * t - 0.15], -1)
    cloth = Material("cloth", base_color=_CLAY.base_color, roughness=0.9, double_sided=True)
    return _scene("open", {"sail": (sheet(points), cloth)}, _SUN)


def _screen() -> Scene:
    """A board whose texture cuts round holes."""
    y, x = np.mgrid[0:128, 0:128] / 128.0
    solid = np.hypot((4 * x) % 1 - 0.5, (4 * y) % 1 - 0.5) > 0.3
    pixels = np.full((128, 128, 4), 255, np.uint8)
    pixels[..., 3] = 255 * solid
    pierced = Material(
        "pierced", base_color=(1, 1, 1, 1), roughness=0.9, double_sided=True, alpha_mode="mask",
        base_color_texture=Texture(Image(pixels, "holes")),
    )  # fmt: skip
    board = flat([(-0.7, 0, 0.5), (0.7, 0, 0.5), (0.7, 0, -0.5), (-0.7, 0, -0.5)], (0, 1, 0),
                 [(0, 1), (1, 1), (1, 0), (0, 0)])  # fmt: skip
    return _scene("masked", {"board": (board.placed(translation(0, 1.3, 0) @ rotation("x", 0.3)), pierced)}, _SUN)


def _rectangles() -> dict[str, Situation]:
    rect: Any = getattr(model, "RectLight", None)
    if rect is None:
        return {}
    aim = tuple(np.subtract((0.1, 1.0, -0.3), _LAMP))
    return {"rect": _lit_by("rect", rect(position=_LAMP, direction=aim, intensity=60.0, width=1.0, height=0.5))}


SITUATIONS: Mapping[str, Situation] = {
    "directional": _lit_by("directional", _SUN),
    "spot": _lit_by("spot", SpotLight(_LAMP, (-0.5, -0.8, -0.7), 60.0, inner_angle=0.4, outer_angle=0.75)),
    "point": _lit_by("point", PointLight(_LAMP, 60.0)),
    **_rectangles(),
    "curved": Situation("receivers", "another object, curved", _curved),
    "itself": Situation("receivers", "the caster itself", _itself),
    "inside": Situation("receivers", "seen from inside a shadow", _shaded_eye),
    "open": Situation("casters", "an open sheet", _sail),
    "masked": Situation("casters", "a pierced texture", _screen),
}
"""Every question by its name. The first, a plane under a closed caster and a directional light, all may be held to."""
