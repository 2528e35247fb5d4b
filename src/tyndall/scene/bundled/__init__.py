"""Scenes that come with Tyndall, modelled by formulas: nothing is downloaded, and a seed gives the same bits each time.

Those for light in the air, ``box``, ``blinds`` and ``courtyard``, have the character and the exact triangle count of a
scene of S1's comparison of volumetric techniques (*Bunny Box*, *Classroom*, *San Miguel*), a light that makes shafts, a
medium, and in ``looks`` the parameters that S1 gives its techniques in that scene.

Those for shadows have no medium: ``shadows`` is the scene of S4's comparison of shadow techniques, of any number of
triangles and lights; ``fence``, ``foliage`` and ``interior`` are hard cases, each of another kind.

>>> from tyndall.scene import bundled
>>> bundled.SCENES["box"](lights=3).triangle_count == bundled.TRIANGLES["box"]
True
>>> bundled.shadows(triangles=10_000, lights=5).triangle_count
10000
"""

from __future__ import annotations

from functools import partial
from typing import Protocol

from tyndall.gpu.params import ParameterError
from tyndall.scene.bundled.blinds import TRIANGLES as _BLINDS
from tyndall.scene.bundled.blinds import blinds
from tyndall.scene.bundled.box import TRIANGLES as _BOX
from tyndall.scene.bundled.box import box
from tyndall.scene.bundled.courtyard import TRIANGLES as _COURTYARD
from tyndall.scene.bundled.courtyard import courtyard
from tyndall.scene.bundled.fence import TRIANGLES as _FENCE
from tyndall.scene.bundled.fence import fence
from tyndall.scene.bundled.foliage import TRIANGLES as _FOLIAGE
from tyndall.scene.bundled.foliage import foliage
from tyndall.scene.bundled.interior import TRIANGLES as _INTERIOR
from tyndall.scene.bundled.interior import interior
from tyndall.scene.bundled.shadows import TRIANGLES as _SHADOWS
from tyndall.scene.bundled.shadows import shadows
from tyndall.scene.model import Scene

__all__ = [
    "SCENES",
    "TRIANGLES",
    "SceneFunction",
    "blinds",
    "box",
    "courtyard",
    "fence",
    "foliage",
    "interior",
    "named",
    "shadows",
]


class SceneFunction(Protocol):
    """Builds a bundled scene; the first line of its docstring describes it."""

    def __call__(self, *, lights: int = 1, seed: int = 0) -> Scene: ...


SCENES: dict[str, SceneFunction] = {
    "box": box,
    "blinds": blinds,
    "courtyard": courtyard,
    "shadows": shadows,
    "foliage": foliage,
    "interior": interior,
    "fence": fence,
}
"""The bundled scenes by name: those for light in the air, then those for shadows, each smallest first."""

TRIANGLES: dict[str, int] = {
    "box": _BOX,
    "blinds": _BLINDS,
    "courtyard": _COURTYARD,
    "shadows": _SHADOWS,
    "foliage": _FOLIAGE,
    "interior": _INTERIOR,
    "fence": _FENCE,
}
"""Exact triangle counts, known without building anything; an instanced mesh counts once for each instance.

``shadows`` has the count that it is asked for; this is its default.
"""


def named(name: str) -> SceneFunction | None:
    """The scene of a name, or of one with a number of triangles, ``shadows:100000``; None where there is no such name.

    What is wrong with the number is said when the scene is built.
    """
    scene, colon, triangles = name.partition(":")
    if scene not in SCENES:
        return None
    return partial(_of_size, scene, triangles) if colon else SCENES[scene]


def _of_size(scene: str, triangles: str, *, lights: int = 1, seed: int = 0) -> Scene:
    if scene != "shadows":
        raise ParameterError(
            f"triangles: {scene} has {TRIANGLES[scene]:,}; only shadows has as many as it is asked for"
        )
    if not (triangles.isascii() and triangles.isdecimal() and len(triangles) < 19):
        raise ParameterError(f"triangles: '{triangles}' is no number of them; shadows:100000 has 100,000")
    return shadows(triangles=int(triangles), lights=lights, seed=seed)
