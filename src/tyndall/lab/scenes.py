"""A scene by what a person typed: the name of a bundled one, a scene JSON, or a mesh file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tyndall.gpu.params import ParameterError, nearest, replace
from tyndall.lab import bundled
from tyndall.scene.errors import SceneError
from tyndall.scene.files import MESH_SUFFIXES, SUFFIXES, load
from tyndall.scene.model import Scene
from tyndall.scene.stage import stage


def open_scene(name: str, lights: int | None = None) -> Scene:
    """The scene that ``name`` stands for; a mesh file is put on a stage, with a camera, a light and a medium.

    Args:
        name: a bundled scene's name, with ``:`` and a size where it has any (``shadows:100000``, ``swarm:10000``), or
            the path of a file.
        lights: how many lights; only a bundled scene places them.

    Raises:
        ParameterError: neither a scene nor a file, or a number of lights that the scene does not take.
        SceneError: the file is wrong.
    """
    make = bundled.named(name)
    if make is not None:
        return make() if lights is None else make(lights=lights)
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES and not path.exists():
        known = ", ".join(bundled.SCENES)
        raise ParameterError(
            f"no scene '{name}'{nearest(name, bundled.SCENES)}; there are {known}, and files of {', '.join(SUFFIXES)}"
        )
    if lights is not None:
        raise ParameterError(f"lights: {name} has its own lights; only a bundled scene places them")
    scene = load(path)
    scene = scene.with_(name=scene.name.encode(errors="replace").decode())  # a file's name need not be Unicode
    if path.suffix.lower() in MESH_SUFFIXES:
        return stage(scene)
    _check_looks(scene, name)
    return scene


def _check_looks(scene: Scene, name: str) -> None:
    """Parameters of techniques and of rays in a scene file are right, also those of techniques that are not drawn.

    Raises:
        SceneError: one line for each that is not.
    """
    from tyndall.sdf.marching import Marching
    from tyndall.techniques import FAMILIES

    members: dict[str, type[Any]] = {"marching": Marching}
    members |= {member: cls for family in FAMILIES.values() for member, cls in family.members.items()}
    wrong = []
    for technique, look in scene.looks.items():
        if technique not in members:
            wrong.append(f"looks.{technique}: no such technique{nearest(technique, members)}")
            continue
        for parameter, value in look.items():
            try:
                replace(members[technique](), {parameter: value})
            except ParameterError as error:
                wrong.append(f"looks.{technique}.{error}")
    if wrong:
        raise SceneError(name, wrong)
