"""Implicit scenes that come with Tyndall: shapes alone, no triangles; a seed gives the same each time.

``portrait``, ``snail``, ``jumper`` and ``temple`` have the subjects and the complexity of the four scenes that S5
measures; they are Tyndall's own models. ``swarm`` is any number of primitives that melt into each other. All move
(:attr:`tyndall.scene.model.Scene.motion`).

>>> from tyndall.sdf import scenes
>>> scenes.swarm(count=10).name
'swarm'
"""

from __future__ import annotations

from tyndall.sdf.scenes.jumper import jumper as jumper
from tyndall.sdf.scenes.portrait import portrait as portrait
from tyndall.sdf.scenes.snail import snail as snail
from tyndall.sdf.scenes.swarm import swarm as swarm
from tyndall.sdf.scenes.temple import temple as temple

NODES: dict[str, int] = {"portrait": 762, "snail": 1060, "jumper": 683, "temple": 1377, "swarm": 4003}
"""Nodes of the shapes of each, known without building anything; ``swarm`` has four for each
primitive, and three; this is its default."""
