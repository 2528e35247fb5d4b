"""Scenes that come with Tyndall, modelled by formulas: nothing is downloaded, and a seed gives the same bits each time.

Each has the character and the exact triangle count of a scene of S1's comparison of volumetric techniques (*Bunny
Box*, *Classroom*, *San Miguel*), a camera, a light that makes shafts, a medium, and in ``looks`` the parameters that
S1 gives its techniques in that scene.

>>> from tyndall.scene import bundled
>>> bundled.SCENES["box"](lights=3).triangle_count == bundled.TRIANGLES["box"]
True
"""

from __future__ import annotations

from typing import Protocol

from tyndall.scene.bundled.blinds import TRIANGLES as _BLINDS
from tyndall.scene.bundled.blinds import blinds
from tyndall.scene.bundled.box import TRIANGLES as _BOX
from tyndall.scene.bundled.box import box
from tyndall.scene.bundled.courtyard import TRIANGLES as _COURTYARD
from tyndall.scene.bundled.courtyard import courtyard
from tyndall.scene.model import Scene

__all__ = ["SCENES", "TRIANGLES", "SceneFunction", "blinds", "box", "courtyard"]


class SceneFunction(Protocol):
    """Builds a bundled scene; the first line of its docstring describes it."""

    def __call__(self, lights: int = 1, seed: int = 0) -> Scene: ...


SCENES: dict[str, SceneFunction] = {"box": box, "blinds": blinds, "courtyard": courtyard}
"""The bundled scenes by name, smallest first."""

TRIANGLES: dict[str, int] = {"box": _BOX, "blinds": _BLINDS, "courtyard": _COURTYARD}
"""Exact triangle counts, known without building anything; an instanced mesh counts once for each instance."""
