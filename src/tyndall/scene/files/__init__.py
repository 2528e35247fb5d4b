"""Scenes in files: the scene JSON, and the mesh formats glTF/GLB, OBJ, PLY and STL.

:func:`load` chooses the reader by the file's suffix; :func:`save` writes the scene JSON (``docs/scene-format.md``),
which is lossless. A file is never trusted: counts are checked against the file's size before anything is allocated,
references stay inside the file's folder, and every mistake is one line of a
:class:`~tyndall.scene.errors.SceneError`.

What a mesh file has no word for (camera, lights, a medium) is left at its default; :func:`tyndall.scene.stage.stage`
adds a stage. Axes are taken as they are: +Y is up, and a file with another idea of up (many STL files) lies on its
side.
"""

from __future__ import annotations

import importlib
from os import PathLike
from pathlib import Path
from typing import Any

from tyndall.gpu.params import nearest
from tyndall.scene.errors import SceneError
from tyndall.scene.files.source import regular_file
from tyndall.scene.model import Scene

_READERS = {
    ".json": "scene_json",
    ".gltf": "gltf",
    ".glb": "gltf",
    ".obj": "obj",
    ".ply": "ply",
    ".stl": "stl",
}
SUFFIXES = tuple(_READERS)
MESH_SUFFIXES = tuple(suffix for suffix in SUFFIXES if suffix != ".json")


def load(path: str | PathLike[str]) -> Scene:
    """Read a scene JSON or a mesh file.

    Arrays of GLB, binary PLY and scene JSON are memory-mapped where their layout allows, read-only.

    Raises:
        SceneError: the file is missing, of an unknown kind, or wrong; one line for each mistake.
    """
    file = Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        known = ", ".join(SUFFIXES)
        raise SceneError(file, f"not one of the kinds that can be read, {known}{nearest(file.suffix, SUFFIXES)}")
    regular_file(file)
    module = importlib.import_module(f"{__name__}.{reader}")
    try:
        scene: Scene = module.load(file)
    except OSError as error:
        raise SceneError(file, f"cannot be read: {error.strerror or error}") from error
    except MemoryError as error:
        raise SceneError(file, "needs more memory than there is") from error
    return scene


def save(scene: Scene, path: str | PathLike[str]) -> None:
    """Write the scene JSON and, beside it, its geometry and texels as ``NAME-<hash>.bin``; lossless.

    Both files appear whole or not at all, the JSON last, so that an interruption leaves what was there before.

    Raises:
        SceneError: the path does not end in ``.json``, cannot be written, or the scene holds what JSON cannot (NaN).
    """
    file = Path(path)
    if file.suffix.lower() != ".json":
        raise SceneError(file, "a scene is saved as .json")
    from tyndall.scene.files.scene_json import save as save_json

    try:
        save_json(scene, file)
    except OSError as error:
        raise SceneError(file, f"cannot be written: {error.strerror or error}") from error


def scene_schema() -> dict[str, Any]:
    """The JSON schema (2020-12) of the scene JSON, generated from the parameters' declarations."""
    from tyndall.scene.files.schema import json_schema

    return json_schema()
