"""A scene by what a person typed: the name of a bundled one, a scene JSON, or a mesh file."""

from __future__ import annotations

from pathlib import Path

from tyndall.gpu.params import ParameterError, nearest
from tyndall.scene import bundled
from tyndall.scene.files import MESH_SUFFIXES, SUFFIXES, load
from tyndall.scene.model import Scene
from tyndall.scene.stage import stage


def open_scene(name: str, lights: int | None = None) -> Scene:
    """The scene that ``name`` stands for; a mesh file is put on a stage, with a camera, a light and a medium.

    Args:
        name: a bundled scene's name, or the path of a file.
        lights: how many lights; only a bundled scene places them.

    Raises:
        ParameterError: neither a scene nor a file, or a number of lights that the scene does not take.
        SceneError: the file is wrong.
    """
    make = bundled.SCENES.get(name)
    if make is not None:
        return make() if lights is None else make(lights=lights)
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES and not path.exists():
        known = ", ".join(bundled.SCENES)
        raise ParameterError(
            f"no scene '{name}'{nearest(name, bundled.SCENES)}; there are {known}, and files of {', '.join(SUFFIXES)}"
        )
    if lights is not None:
        raise ParameterError(f"--lights: {name} has its own lights; only a bundled scene places them")
    scene = load(path)
    return stage(scene) if path.suffix.lower() in MESH_SUFFIXES else scene
