"""The scenes that come with Tyndall, of triangles and of implicit surfaces, by name.

>>> from tyndall.lab import bundled
>>> bundled.named("shadows:10000")().triangle_count
10000
>>> len(bundled.named("swarm:10")().implicits)
2
"""

from __future__ import annotations

from functools import partial

from tyndall.gpu.params import ParameterError
from tyndall.scene.bundled import SCENES as _MESHES
from tyndall.scene.bundled import TRIANGLES as _TRIANGLES
from tyndall.scene.bundled import SceneFunction as SceneFunction
from tyndall.scene.bundled import blinds as blinds
from tyndall.scene.bundled import box as box
from tyndall.scene.bundled import courtyard as courtyard
from tyndall.scene.bundled import fence as fence
from tyndall.scene.bundled import foliage as foliage
from tyndall.scene.bundled import interior as interior
from tyndall.scene.bundled import named as _named
from tyndall.scene.bundled import shadows as shadows
from tyndall.scene.model import Scene
from tyndall.sdf.scenes import NODES as _NODES
from tyndall.sdf.scenes import jumper as jumper
from tyndall.sdf.scenes import portrait as portrait
from tyndall.sdf.scenes import snail as snail
from tyndall.sdf.scenes import swarm as swarm
from tyndall.sdf.scenes import temple as temple

SCENES: dict[str, SceneFunction] = {
    **_MESHES,
    "portrait": portrait,
    "snail": snail,
    "jumper": jumper,
    "temple": temple,
    "swarm": swarm,
}
"""The bundled scenes by name: those of triangles, then those of implicit surfaces."""

TRIANGLES: dict[str, int] = {name: _TRIANGLES.get(name, 0) for name in SCENES}
"""Exact triangle counts, known without building anything; ``shadows`` has the count that it is asked for."""

NODES: dict[str, int] = {name: _NODES.get(name, 0) for name in SCENES}
"""Nodes of the implicit surfaces' shapes; ``swarm`` has as many primitives as it is asked for."""


def named(name: str) -> SceneFunction | None:
    """The scene of a name, or of one with a size, ``shadows:100000`` or ``swarm:100``; None where there is none.

    What is wrong with the size is said when the scene is built.
    """
    scene, colon, count = name.partition(":")
    if scene not in _NODES:
        return _named(name)
    return partial(_of_size, scene, count) if colon else SCENES[scene]


def _of_size(scene: str, count: str, *, lights: int = 1, seed: int = 0) -> Scene:
    if scene != "swarm":
        raise ParameterError(f"count: {scene} has no number of primitives; only swarm has as many as it is asked for")
    if not (count.isascii() and count.isdecimal() and len(count) < 19):
        raise ParameterError(f"count: '{count}' is no number of primitives; swarm:1000 has 1,000")
    return swarm(count=int(count), lights=lights, seed=seed)
