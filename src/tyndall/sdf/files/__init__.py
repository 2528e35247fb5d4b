"""Shapes, materials, shaders and scenes of implicit surfaces in JSON files; the format is told in ``docs/sdf-json.md``.

:func:`load` reads what S5 calls custom primitives, fragment shaders, materials, models and scenes. What a file refers
to by name is looked for in the file itself and in the JSON files of its folder. :func:`save` writes a shape as one
model file that needs no other, and that brings back an equal shape bit for bit.

Files are not trusted: their code goes through :mod:`tyndall.sdf.sandbox`, references stay in the folder, and a model
that contains itself, or is more than a million nodes, is refused. All mistakes of a file are told at once, a line each.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from tyndall.gpu.params import ParameterError
from tyndall.scene.errors import SceneError
from tyndall.scene.model import Implicit, Material, Scene
from tyndall.sdf.shading import FragmentShader
from tyndall.sdf.shape import Shape
from tyndall.sdf.snippets import SnippetKind


def load(path: str | PathLike[str]) -> Shape | Scene | Material | FragmentShader | SnippetKind:
    """What a JSON file holds: the shape of a model, a scene, a material, a shader, or the constructor of a primitive.

    Raises:
        SceneError: the file is missing or wrong; one line for each mistake.
    """
    from tyndall.sdf.files.reader import Folder

    file = Path(path)
    try:
        return Folder(file.parent).open(file)  # type: ignore[no-any-return]
    except OSError as error:
        raise SceneError(file, f"cannot be read: {error.strerror or error}") from error


def save(shape: Shape, path: str | PathLike[str], *, name: str = "") -> None:
    """Write a shape as a model, with its materials, shaders and primitives in it.

    Args:
        name: the model's name; that of the file unless told otherwise.

    Raises:
        SceneError: the path does not end in ``.json`` or cannot be written, or the shape holds what JSON cannot.
        ParameterError: it is no shape.
    """
    from tyndall.sdf.files.writer import write_model

    file = Path(path)
    if not isinstance(shape, Shape):
        raise ParameterError(f"shape: {type(shape).__name__} is no shape")
    if file.suffix.lower() != ".json":
        raise SceneError(file, "a shape is saved as .json")
    try:
        write_model(shape, file, name or file.stem)
    except OSError as error:
        raise SceneError(file, f"cannot be written: {error.strerror or error}") from error


def load_scene(path: Path) -> Scene:
    """A scene of S5's, or a model as a scene, on a stage (:func:`tyndall.scene.stage.stage`) for what it lacks.

    Raises:
        SceneError: one line for each mistake.
    """
    from tyndall.scene.stage import stage

    made = load(path)
    if isinstance(made, Shape):
        try:
            made = Scene(implicits=(Implicit(made, name=path.stem),), name=path.stem)
        except ParameterError as error:
            raise SceneError(path, f"model: {error}") from error
    if not isinstance(made, Scene):
        kinds = {SnippetKind: "custom primitive", FragmentShader: "fragment shader", Material: "material"}
        what = next(text for kind, text in kinds.items() if isinstance(made, kind))
        raise SceneError(path, f"is a {what}; a model or a scene that uses it can be drawn")
    return stage(made)


def pack(implicits: Any) -> dict[str, Any]:
    """The implicit surfaces of a scene as plain JSON values, for the scene file.

    Raises:
        ParameterError: they hold what JSON cannot.
    """
    from tyndall.sdf.files.writer import pack_objects

    return pack_objects(implicits)


def unpack(path: Path, data: Any, text: str) -> Any:
    """The implicit surfaces of a scene file.

    Args:
        path: of the scene file.
        data: what :func:`pack` gave, from the key ``implicits``.
        text: the whole file, for the places of mistakes in code.

    Raises:
        SceneError: one line for each mistake.
    """
    from tyndall.sdf.files.reader import Folder

    return Folder(path.parent).unpack(path, data, text)


__all__ = ["load", "load_scene", "pack", "save", "unpack"]
