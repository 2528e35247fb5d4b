"""Reading of S5's JSON and its extensions; see ``docs/sdf-json.md``."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tyndall.gpu.params import Field, ParameterError, convert, describe_type, fields_of, nearest
from tyndall.scene.errors import SceneError
from tyndall.scene.files.source import regular_file, shorten
from tyndall.scene.model import IDENTITY, Implicit, Material, Scene
from tyndall.sdf.files import places
from tyndall.sdf.files.names import GROUP, OPERATIONS, is_data, mismatch, node_classes, width
from tyndall.sdf.sandbox import Origin, SnippetError
from tyndall.sdf.shading import FragmentShader, Property, ShadedMaterial
from tyndall.sdf.shape import NUMBERS, Combination, Named, Painted, Primitive, Shape, Transformed
from tyndall.sdf.snippets import Snippet, SnippetKind, SnippetSource, kind_of

MOST_NODES = 1 << 20
MOST_BYTES = 256 << 20  # of a file
MOST_FILES = 4096  # of a folder that are looked through for a name
MOST_MISTAKES = 50
FIRST_ID = 32  # of a custom primitive

_COMMON = ("type", "transform", "material_id", "name", "children", "data")
_TABLES = ("materials", "shaders", "primitives")
_KINDS = {
    "primitive": ("name", "id", "code", "lipschitz", "box", "growth", "exact"),
    "shader": ("name", "properties", "code"),
    "model": ("name", "model", *_TABLES),
    "scene": ("name", "scene", "camera", "lights", "medium", "background", "ambient", "looks", *_TABLES),
}
_SURFACE = [f for f in fields_of(Material) if not f.name.endswith("texture")]


def kind_of_file(data: Any) -> str:
    """ "primitive", "shader", "material", "model" or "scene"; "" for something else."""
    if not isinstance(data, dict):
        return ""
    for key, kind in (("scene", "scene"), ("model", "model"), ("base_shader", "material")):
        if key in data:
            return kind
    if "code" in data:
        return "primitive" if "id" in data else "shader"
    own = set(data) - {"name"}
    return "material" if own and own <= {f.name for f in _SURFACE} else ""


def is_scene(data: Any) -> bool:
    """Whether a JSON value is one of S5's models or scenes, not a scene of Tyndall's own format."""
    return isinstance(data, dict) and "version" not in data and kind_of_file(data) in ("model", "scene")


class Folder:
    """The JSON files of a folder, each read once, by what they define."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._files: dict[Path, _File] = {}
        self._named: dict[tuple[str, Any], Path] | None = None
        self._made: dict[Path, Any] = {}
        self._open: list[Path] = []

    def open(self, path: Path) -> Any:
        """What a file defines.

        Raises:
            SceneError: a line for each mistake.
        """
        file = self.file(path)
        if not kind_of_file(file.data):
            raise SceneError(path, "is no primitive, shader, material, model or scene of implicit surfaces")
        return self.make(file)

    def unpack(self, path: Path, data: Any, text: str) -> tuple[Implicit, ...]:
        """The objects that ``pack`` wrote into a scene file.

        Raises:
            SceneError: a line for each mistake.
        """
        file = _File(self, path, data, text, ("implicits",))
        made = file.objects()
        file.finish()
        return made

    def file(self, path: Path) -> _File:
        """A file's JSON value.

        Raises:
            SceneError: it is not there, or is not JSON.
        """
        if path not in self._files:
            if regular_file(path) > MOST_BYTES:
                raise SceneError(path, f"more than {MOST_BYTES} bytes")
            try:
                text = path.read_bytes().decode("utf-8-sig")
                self._files[path] = _File(self, path, places.parse(text), text, ())
            except ValueError as error:
                raise SceneError(path, f"not JSON: {shorten(str(error), 200)}") from None
        return self._files[path]

    def make(self, file: _File) -> Any:
        """What a file defines, made once.

        Raises:
            SceneError: a line for each mistake, or the file contains itself.
        """
        if file.path in self._open:
            raise SceneError(file.path, "contains itself")
        if file.path not in self._made:
            self._open.append(file.path)
            try:
                made = file.make()
                file.finish()
                self._made[file.path] = made
            except SceneError as error:
                self._made[file.path] = error
                raise
            finally:
                self._open.pop()
        made = self._made[file.path]
        if isinstance(made, SceneError):
            raise SceneError(file.path, made.mistakes)
        return made

    def find(self, kind: str, key: str | int) -> _File | None:
        """The file that defines something of a kind, by its name, its ``id``, or the file's own name."""
        if self._named is None:
            self._named = {}
            files = sorted(self.directory.glob("*.json"))[:MOST_FILES]
            for path in files:
                try:
                    data = self.file(path).data
                except (SceneError, OSError):
                    continue  # told when something refers to it
                found = kind_of_file(data)
                keys = [data.get("name"), data.get("id")] if found else []
                for name in keys:
                    if isinstance(name, (str, int)) and found:
                        self._named.setdefault((found, name), path)
            for path in files:
                found = kind_of_file(self._files[path].data) if path in self._files else ""
                if found:
                    self._named.setdefault((found, path.stem), path)
        path_of = self._named.get((kind, key))
        return None if path_of is None else self.file(path_of)

    def names(self, kind: str) -> list[str]:
        """What there is of a kind, for hints."""
        return [name for found, name in self._named or () if found == kind and isinstance(name, str)]


class _File:
    """A JSON file, and the mistakes that are found in it."""

    def __init__(self, folder: Folder, path: Path, data: Any, text: str, root: places.Path) -> None:
        self.folder, self.path, self.data, self.text, self._root = folder, path, data, text, root
        self.wrong: list[str] = []
        self._places: Mapping[places.Path, int] | None = None
        self._shaders: list[FragmentShader | None] = []
        self._materials: list[Material | None] = []
        self._customs: dict[str | int, SnippetKind | None] = {}
        self._told: set[Path] = set()

    # --- mistakes ---

    def stop(self, where: str, message: object) -> None:
        """Note a mistake."""
        root = "".join(f".{step}" for step in self._root)[1:]
        full = f"{root}.{where}" if root and where else root or where
        told = shorten(str(message), 400)
        self.wrong.append(f"{full}: {told}" if full else told)

    def finish(self) -> None:
        """Raise what was noted."""
        if self.wrong:
            more = len(self.wrong) - MOST_MISTAKES
            raise SceneError(
                self.path, [*self.wrong[:MOST_MISTAKES], *([f"and {more} more mistakes"] if more > 0 else [])]
            )

    def _origin(self, *steps: str | int) -> Origin:
        if self._places is None:
            self._places = places.places(self.text)
        start = self._places.get((*self._root, *steps))
        name = self.path.name
        return Origin(f"{name}:{'.'.join(map(str, steps))}") if start is None else Origin(name, self.text, start, True)

    def _known(self, where: str, data: Mapping[str, Any], known: Iterable[str]) -> None:
        known = list(known)
        for key in data:
            if key not in known:
                self.stop(_join(where, key), f"no such field{nearest(key, known)}")

    def _object(self, where: str, value: Any) -> dict[str, Any] | None:
        if isinstance(value, dict):
            return value
        self.stop(where, "is not an object")
        return None

    def _list(self, where: str, value: Any) -> list[Any]:
        if isinstance(value, list):
            return value
        self.stop(where, "is not a list")
        return []

    def _text(self, where: str, data: Mapping[str, Any], key: str, default: str | None = None) -> str | None:
        value = data.get(key, default)
        if isinstance(value, str):
            return value
        self.stop(_join(where, key), "is missing" if value is None else "is not a text")
        return None

    def _number(self, where: str, value: Any) -> float | None:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= 1e30:
            return float(value)
        self.stop(where, f"{_shown(value)} is not a number")
        return None

    def _declared(self, where: str, f: Field, value: Any) -> Any:
        """A declared parameter's value, or None with a mistake noted."""
        try:
            if mismatch(f.type, value):
                raise ParameterError(f"{f.name}: {_shown(value)} is not {describe_type(f.type)}")
            return convert(f, _tuples(value))
        except ParameterError as error:
            self.stop(where, str(error).removeprefix(f"{f.name}: "))
            return None

    def _of_other(self, where: str, kind: str, key: str | int) -> Any:
        """What another file of the folder defines."""
        try:
            file = self.folder.find(kind, key)
            if file is None:
                hint = nearest(key, self.folder.names(kind)) if isinstance(key, str) else ""
                self.stop(where, f"there is no {kind} {_shown(key)} in this file or its folder{hint}")
                return None
            return self.folder.make(file)
        except SceneError as error:
            name = error.args[0].split(": ", 1)[0]
            if Path(name) not in self._told:
                self._told.add(Path(name))
                for mistake in error.mistakes:
                    self.stop(where, f"{Path(name).name}: {mistake}")
            else:
                self.stop(where, f"{Path(name).name} has mistakes")
            return None

    # --- what a file defines ---

    def make(self) -> Any:
        """What the whole file is."""
        kind = kind_of_file(self.data)
        if kind == "primitive":
            return self._primitive("", self.data, ())
        if kind == "shader":
            return self._shader("", self.data, ())
        if kind == "material":
            return self._material("", self.data)
        self._known("", self.data, _KINDS[kind])
        self._tables()
        try:
            return self._model() if kind == "model" else self._scene()
        except RecursionError:
            self.stop(kind, "nested too deeply")
            return None

    def _tables(self) -> None:
        for i, value in enumerate(self._list("primitives", self.data.get("primitives", []))):
            where = f"primitives[{i}]"
            if (data := self._object(where, value)) is not None:
                made = self._primitive(where, data, ("primitives", i))
                for key in (data.get("name"), data.get("id")):
                    if isinstance(key, (str, int)) and not isinstance(key, bool):
                        if isinstance(key, int) and key in self._customs:
                            self.stop(f"{where}.id", f"{key} is another primitive's")
                        self._customs.setdefault(key, made)
        for i, value in enumerate(self._list("shaders", self.data.get("shaders", []))):
            data = self._object(f"shaders[{i}]", value)
            self._shaders.append(None if data is None else self._shader(f"shaders[{i}]", data, ("shaders", i)))
        for i, value in enumerate(self._list("materials", self.data.get("materials", []))):
            where = f"materials[{i}]"
            if isinstance(value, str):
                self._materials.append(self._of_other(where, "material", value))
            else:
                data = self._object(where, value)
                self._materials.append(None if data is None else self._material(where, data))

    def _model(self) -> Shape | None:
        self._text("", self.data, "name", self.path.stem)
        return self._node("model", self.data["model"])

    def _scene(self) -> Scene | None:
        import pydantic

        from tyndall.scene.files import schema
        from tyndall.scene.files.scene_json import VERSION

        name = self._text("", self.data, "name", self.path.stem)
        implicits = []
        for i, value in enumerate(self._list("scene", self.data["scene"])):
            where = f"scene[{i}]"
            if (shape := self._node(where, value)) is not None and (made := self._implicit(where, shape)) is not None:
                implicits.append(made)
        own = {k: v for k, v in self.data.items() if k not in ("scene", "name", *_TABLES)}
        try:
            record = schema.SceneRecord.model_validate(
                {"version": VERSION, **_tuples(own)}, context=schema.Extent({}, 0)
            )
        except pydantic.ValidationError as error:
            self.wrong += schema.mistakes(error, own)
            return None
        return Scene(
            (),
            record.lights,
            record.camera,
            record.medium,
            record.background,
            record.ambient,
            {key: dict(look) for key, look in record.looks.items()},
            name or "scene",
            tuple(implicits),
        )

    def _implicit(self, where: str, shape: Shape) -> Implicit | None:
        """An object of its own: what it is placed, called and made of as a whole stays outside of the shape."""
        transform: Any = IDENTITY
        name, material = "", Material()
        if isinstance(shape, Transformed):
            transform, shape = shape.matrix, shape.shape
        if isinstance(shape, Named):
            name, shape = shape.name, shape.shape
        if isinstance(shape, Painted):
            material, shape = shape.surface, shape.shape
        return self._built(where, lambda: Implicit(shape, transform, material, name))  # type: ignore[no-any-return]

    def objects(self) -> tuple[Implicit, ...]:
        """Of a scene file's ``implicits``."""
        if self._object("", self.data) is None:
            return ()
        self._known("", self.data, ("objects", *_TABLES))
        self._tables()
        made: list[Implicit] = []
        for i, value in enumerate(self._list("objects", self.data.get("objects", []))):
            where = f"objects[{i}]"
            if (data := self._object(where, value)) is None:
                continue
            self._known(where, data, ("name", "transform", "material_id", "shape"))
            name = self._text(where, data, "name", "")
            matrix = self._rows(f"{where}.transform", data.get("transform", [list(row) for row in IDENTITY]))
            material = self._by_index(where, data["material_id"]) if "material_id" in data else Material()
            try:
                shape = self._node(f"{where}.shape", data.get("shape"))
            except RecursionError:
                self.stop(f"{where}.shape", "nested too deeply")
                continue
            if shape is not None and material is not None and matrix is not None and name is not None:
                build = _implicit(shape, matrix, material, name)
                if (implicit := self._built(where, build)) is not None:
                    made.append(implicit)
        return tuple(made)

    def _built(self, where: str, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except ParameterError as error:
            self.stop(where, error)
        except SnippetError as error:
            self.stop(where, error)
        return None

    # --- code ---

    def _primitive(self, where: str, data: dict[str, Any], steps: places.Path) -> SnippetKind | None:
        self._known(where, data, _KINDS["primitive"])
        before = len(self.wrong)
        name = self._text(where, data, "name", self.path.stem)
        code = self._text(where, data, "code")
        number = data.get("id")
        if not isinstance(number, int) or isinstance(number, bool) or number < FIRST_ID:
            told = "is missing" if number is None else f"{_shown(number)} is not a whole number ≥ {FIRST_ID}"
            self.stop(_join(where, "id"), told)
        bounds = self._bounds(where, data)
        if name is None or code is None or len(self.wrong) > before:
            return None

        def make() -> SnippetKind:
            source = SnippetSource(name, code, number, self._origin(*steps, "code"))
            return kind_of(source, **{"lipschitz": 1.0, "box": None, "growth": 1.0, "exact": False, **bounds})

        return self._built(_join(where, "code"), make)  # type: ignore[no-any-return]

    def _bounds(self, where: str, data: Mapping[str, Any]) -> dict[str, Any]:
        """What is declared of a snippet, as far as it is told here."""
        found: dict[str, Any] = {}
        for key, lowest in (("lipschitz", 1e-6), ("growth", 1e-6)):
            if key in data and (value := self._number(_join(where, key), data[key])) is not None:
                if value < lowest:
                    self.stop(_join(where, key), f"{value:g} is outside ≥ {lowest:g}")
                found[key] = value
        if "exact" in data:
            if not isinstance(data["exact"], bool):
                self.stop(_join(where, "exact"), f"{_shown(data['exact'])} is not true or false")
            found["exact"] = data["exact"]
        if data.get("box") is not None:
            corners = []
            for i, corner in enumerate(self._list(_join(where, "box"), data["box"])):
                spot = f"{_join(where, 'box')}[{i}]"
                sides = [
                    (-math.inf, math.inf)[i & 1] if x is None else self._number(f"{spot}[{k}]", x)
                    for k, x in enumerate(self._list(spot, corner))
                ]
                corners.append(sides)
            if len(corners) != 2 or any(len(sides) not in (2, 3) for sides in corners):
                self.stop(_join(where, "box"), "is not two corners of three numbers")
            else:
                found["box"] = tuple(tuple(math.nan if x is None else x for x in sides) for sides in corners)
        return found

    def _shader(self, where: str, data: dict[str, Any], steps: places.Path) -> FragmentShader | None:
        self._known(where, data, _KINDS["shader"])
        name = self._text(where, data, "name", self.path.stem)
        code = self._text(where, data, "code")
        properties: list[Property] = []
        before = len(self.wrong)
        for i, value in enumerate(self._list(_join(where, "properties"), data.get("properties", []))):
            spot = f"{_join(where, 'properties')}[{i}]"
            if not isinstance(value, str):
                self.stop(spot, "is not a text")
            elif (made := self._built(spot, lambda text=value: Property.parse(text))) is not None:  # type: ignore[misc]
                properties.append(made)
        if name is None or code is None or len(self.wrong) > before:
            return None
        origin = self._origin(*steps, "code")
        return self._built(  # type: ignore[no-any-return]
            _join(where, "code"), lambda: FragmentShader(name, code, tuple(properties), origin)
        )

    # --- materials ---

    def _material(self, where: str, data: dict[str, Any]) -> Material | None:
        shaded = "base_shader" in data
        extra = ("base_shader", "properties", "lit") if shaded else ()
        self._known(where, data, [*extra, *(f.name for f in _SURFACE)])
        before = len(self.wrong)
        values = {f.name: self._declared(_join(where, f.name), f, data[f.name]) for f in _SURFACE if f.name in data}
        if not shaded:
            return None if len(self.wrong) > before else self._built(where, lambda: Material(**values))
        key, shader = data["base_shader"], None
        spot = _join(where, "base_shader")
        if isinstance(key, int) and not isinstance(key, bool):
            if 0 <= key < len(self._shaders):
                shader = self._shaders[key]
            else:
                self.stop(spot, f"{key} is beyond the last of {len(self._shaders)} shaders")
        elif isinstance(key, str):
            tables = self.data.get("shaders", []) if isinstance(self.data, dict) else []
            own = [i for i, s in enumerate(tables) if isinstance(s, dict) and s.get("name") == key]
            shader = self._shaders[own[0]] if own else self._of_other(spot, "shader", key)
        else:
            self.stop(spot, f"{_shown(key)} is not a text")
        lit = data.get("lit", True)
        if not isinstance(lit, bool):
            self.stop(_join(where, "lit"), f"{_shown(lit)} is not true or false")
        given = self._properties(where, data, shader)
        if shader is None or given is None or len(self.wrong) > before:
            return None
        return ShadedMaterial(**values, shader=shader, values=given, lit=lit)

    def _properties(
        self, where: str, data: Mapping[str, Any], shader: FragmentShader | None
    ) -> tuple[float, ...] | None:
        given: dict[str, tuple[float, ...]] = {}
        known = {p.name: p for p in shader.properties} if shader is not None else {}
        for i, value in enumerate(self._list(_join(where, "properties"), data.get("properties", []))):
            spot = f"{_join(where, 'properties')}[{i}]"
            if (entry := self._object(spot, value)) is None:
                continue
            self._known(spot, entry, ("name", "type", "value"))
            name = self._text(spot, entry, "name")
            if shader is None or name is None:
                continue
            if name not in known:
                self.stop(f"{spot}.name", f"'{name}' is no property of '{shader.name}'{nearest(name, known)}")
                continue
            p = known[name]
            if name in given:
                self.stop(f"{spot}.name", f"'{name}' is given twice")
            if entry.get("type", p.type) != p.type:
                self.stop(f"{spot}.type", f"{_shown(entry['type'])} is not {p.type}, which '{shader.name}' declares")
            try:
                if "value" not in entry:
                    raise ParameterError(f"{name}: is missing")
                given[name] = p.check(_property_value(entry["value"]))
            except ParameterError as error:
                given[name] = (0.0,) * p.width
                self.stop(f"{spot}.value", str(error).removeprefix(f"{name}: "))
        for name in known:
            if shader is not None and name not in given:
                self.stop(_join(where, "properties"), f"'{name}' of '{shader.name}' has no value")
        if shader is None or len(given) < len(known):
            return None
        return tuple(x for name in known for x in given[name])

    def _by_index(self, where: str, index: Any) -> Material | None:
        spot = f"{where}.material_id"
        if not isinstance(index, int) or isinstance(index, bool) or index < 0:
            self.stop(spot, f"{_shown(index)} is not a whole number ≥ 0")
        elif index >= len(self._materials):
            self.stop(spot, f"{index} is beyond the last of {len(self._materials)} materials")
        else:
            return self._materials[index]
        return None

    # --- nodes ---

    def _node(self, where: str, value: Any) -> Shape | None:
        """A node with all below it, or None with mistakes noted."""
        if (data := self._object(where, value)) is None:
            return None
        before = len(self.wrong)
        children = [
            self._node(f"{where}.children[{i}]", child)
            for i, child in enumerate(self._list(f"{where}.children", data.get("children", [])))
        ]
        inside = [child for child in children if child is not None]
        shape = self._core(where, data, inside, len(children))
        if "material_id" in data:
            material = self._by_index(where, data["material_id"])
            shape = None if shape is None or material is None else Painted(shape, material)
        if "name" in data and (name := self._text(where, data, "name")) is not None and shape is not None:
            shape = Named(shape, name)
        if "transform" in data and data["transform"] != {}:
            matrix = self._transform(f"{where}.transform", data["transform"])
            if shape is not None and matrix is not None:
                placed = shape
                shape = self._built(f"{where}.transform", lambda: Transformed(placed, matrix))
        if shape is not None and shape.count > MOST_NODES:
            self.stop(where, f"{shape.count} nodes; a shape has at most {MOST_NODES}")
        return shape if len(self.wrong) == before else None

    def _core(self, where: str, data: dict[str, Any], children: list[Shape], count: int) -> Shape | None:
        """A node without its material, name and place."""
        kind = data.get("type", data.get("model"))
        if not isinstance(kind, str):
            self.stop(f"{where}.type", "is missing" if kind is None else f"{_shown(kind)} is not a text")
            return None
        group, _, name = kind.partition("/")
        classes = node_classes()
        if group == "Models":
            self._known(where, data, [*_COMMON, "model"])
            made = self._of_other(f"{where}.{'type' if 'type' in data else 'model'}", "model", name)
            return None if made is None else self._with_children(where, made, children)
        if kind == GROUP:
            self._known(where, data, _COMMON)
            return self._one(where, kind, children, count)
        if group == "Operations" and name in OPERATIONS:
            return self._combination(where, name, data, children, count)
        cls = self._class(group, name, data)
        if isinstance(cls, SnippetKind):
            made = self._snippet(where, cls, data)
            return None if made is None else self._with_children(where, made, children)
        if cls is not None:
            return self._of_class(where, kind, cls, data, children, count)
        if group in ("Primitives", "Profiles"):
            key: str | int = data["id"] if isinstance(data.get("id"), int) else name
            hints = [n.partition("/")[2] for n in classes if not n.startswith("Operations/")]
            if nearest(name, hints) and self.folder.find("primitive", key) is None:
                self.stop(f"{where}.type", f"no such primitive: '{name}'{nearest(name, hints)}")
                return None
            custom = self._of_other(f"{where}.type", "primitive", key)
            if not isinstance(custom, SnippetKind):
                return None
            made = self._snippet(where, custom, data)
            return None if made is None else self._with_children(where, made, children)
        known = [*classes, *(f"Operations/{n}" for n in OPERATIONS), GROUP]
        self.stop(f"{where}.type", f"{_shown(kind)} is no kind of node{nearest(kind, known)}")
        return None

    def _class(self, group: str, name: str, data: Mapping[str, Any]) -> Any:
        """The class of a built-in node, or a primitive of this file; None where it is neither."""
        if group in ("Primitives", "Profiles"):
            if (
                (number := data.get("id")) is not None
                and not isinstance(number, (dict, list))
                and number in self._customs
            ):
                return self._customs[number]
            if number is None and f"{group}/{name}" not in node_classes() and name in self._customs:
                return self._customs[name]
            if number is not None:
                return None
        return node_classes().get(f"{group}/{name}") or (
            node_classes().get(f"Primitives/{name}") if group == "Profiles" else None
        )

    def _with_children(self, where: str, shape: Shape, children: Sequence[Shape]) -> Shape | None:
        """A primitive or model with children is their union, itself first."""
        if not children:
            return shape
        return self._built(where, lambda: Combination((shape, *children)))  # type: ignore[no-any-return]

    def _one(self, where: str, kind: str, children: list[Shape], count: int) -> Shape | None:
        """The one child that an operation is done to: what are several is their union."""
        if not count:
            self.stop(f"{where}.children", f"'{kind}' has none")
        if len(children) != count or not count:
            return None
        return children[0] if count == 1 else self._built(where, lambda: Combination(tuple(children)))

    def _combination(
        self, where: str, name: str, data: dict[str, Any], children: list[Shape], count: int
    ) -> Shape | None:
        self._known(where, data, [*_COMMON, "factor", "blend"])
        known = {f.name: f for f in fields_of(Combination)}
        before = len(self.wrong)
        smooth = self._declared(f"{where}.factor", known["smooth"], data.get("factor", 0.0))
        blend = self._declared(f"{where}.blend", known["blend"], data.get("blend", known["blend"].default))
        if name.startswith("Smooth") and "factor" not in data:
            self.stop(f"{where}.factor", "is missing")
        if not count:
            self.stop(f"{where}.children", f"'Operations/{name}' has none")
        if len(children) != count or len(self.wrong) > before:
            return None
        return self._built(  # type: ignore[no-any-return]
            where, lambda: Combination(tuple(children), OPERATIONS[name], smooth, blend)
        )

    def _of_class(
        self, where: str, kind: str, cls: type[Shape], data: dict[str, Any], children: list[Shape], count: int
    ) -> Shape | None:
        if hasattr(cls, "from_data"):
            own = {k: v for k, v in data.items() if k not in _COMMON and k != "model"}
            made = self._built(where, lambda: cls.from_data(own))
            return None if made is None else self._with_children(where, made, children)
        before = len(self.wrong)
        declared = {f.name: f for f in fields_of(cls)}
        # A parameter of a class that is called like a field of every node (a profile's "data") is not foreseen.
        fields = dataclasses.fields(cls)  # type: ignore[arg-type]
        plain = [f.name for f in fields if f.name not in declared and f.name != "shape"]
        self._known(where, data, [*_COMMON, *declared, *plain])
        values = self._data(where, data, cls) if "data" in data else {}
        for name, f in declared.items():
            if name in data:
                values[name] = self._declared(f"{where}.{name}", f, data[name])
            elif name not in values and f.default is dataclasses.MISSING:
                self.stop(f"{where}.{name}", "is missing")
        for name in plain:
            if name in data:
                values[name] = _tuples(data[name])
        if issubclass(cls, Primitive):
            made = None if len(self.wrong) > before else self._built(where, lambda: cls(**values))
            return None if made is None else self._with_children(where, made, children)
        child = self._one(where, kind, children, count)
        if child is None or len(self.wrong) > before:
            return None
        return self._built(where, lambda: cls(shape=child, **values))  # type: ignore[call-arg, no-any-return]

    def _data(self, where: str, data: Mapping[str, Any], cls: type) -> dict[str, Any]:
        """Parameters from S5's eight numbers: those that are numbers, in order. What is beyond the last is ignored."""
        spot = f"{where}.data"
        items = [self._number(f"{spot}[{i}]", x) for i, x in enumerate(self._list(spot, data["data"]))]
        if len(items) > NUMBERS:
            self.stop(spot, f"{len(items)} numbers; there are at most {NUMBERS}")
        values: dict[str, Any] = {}
        at = 0
        for f in fields_of(cls):
            if not is_data(f):
                continue
            own = items[at : at + width(f)]
            at += width(f)
            if not own:
                break
            if len(own) < width(f):
                self.stop(spot, f"{len(items)} numbers; {f.name} needs {at}")
                break
            if None not in own:
                values[f.name] = self._declared(f"{where}.{f.name}", f, own[0] if f.type in (float, int) else own)
        return values

    def _snippet(self, where: str, custom: SnippetKind, data: dict[str, Any]) -> Shape | None:
        self._known(where, data, [*_COMMON, "id", "lipschitz", "box", "growth", "exact"])
        before = len(self.wrong)
        spot = f"{where}.data"
        values = [self._number(f"{spot}[{i}]", x) for i, x in enumerate(self._list(spot, data.get("data", [])))]
        bounds = {**custom.bounds, **self._bounds(where, data)}
        if len(values) > NUMBERS:
            self.stop(spot, f"{len(values)} numbers; there are at most {NUMBERS}")
        if len(self.wrong) > before:
            return None
        numbers = [float(x) for x in values if x is not None]
        # S5 gives eight numbers, whatever a primitive takes.
        numbers = numbers[: custom.source.count] if len(numbers) == NUMBERS else numbers
        low, high = bounds["box"] or ((-math.inf,) * 3, (math.inf,) * 3)
        return self._built(  # type: ignore[no-any-return]
            where,
            lambda: Snippet(
                custom.source, tuple(numbers), bounds["lipschitz"], low, high, bounds["growth"], bounds["exact"]
            ),
        )

    # --- transforms ---

    def _transform(self, where: str, value: Any) -> tuple[tuple[float, ...], ...] | None:
        """4×4 rows of S5's transform: scale, then rotation, then translation."""
        if (data := self._object(where, value)) is None:
            return None
        self._known(where, data, ("position", "rotation", "scale", "matrix"))
        if "matrix" in data:
            if len(data) > 1:
                self.stop(where, "has a matrix and something else")
            return self._rows(f"{where}.matrix", data["matrix"])
        before = len(self.wrong)
        position = self._vector(f"{where}.position", data.get("position", {}), 0.0)
        scale = self._vector(f"{where}.scale", data.get("scale", {}), 1.0)
        turn = self._rotation(f"{where}.rotation", data["rotation"]) if "rotation" in data else None
        if len(self.wrong) > before:
            return None
        linear = np.diag(scale) if turn is None else turn @ np.diag(scale)
        rows = [(*(float(x) for x in linear[i]), float(position[i])) for i in range(3)]
        return (*rows, (0.0, 0.0, 0.0, 1.0))

    def _vector(self, where: str, value: Any, default: float) -> list[float]:
        if isinstance(value, list) and len(value) == 3:
            value = dict(zip("xyz", value, strict=True))
        if (data := self._object(where, value)) is None:
            return [default] * 3
        self._known(where, data, "xyz")
        found = [self._number(f"{where}.{axis}", data.get(axis, default)) for axis in "xyz"]
        return [default if x is None else x for x in found]

    def _rotation(self, where: str, value: Any) -> np.ndarray[Any, Any] | None:
        """3×3 of angles about X, Y and Z, R = Rz·Ry·Rx right-handed, or of a quaternion."""
        if isinstance(value, dict) and "w" in value:
            self._known(where, value, "xyzw")
            q = [self._number(f"{where}.{axis}", value.get(axis, 0.0)) for axis in "xyzw"]
            if None in q:
                return None
            x, y, z, w = (float(c or 0.0) for c in q)
            length = math.sqrt(x * x + y * y + z * z + w * w)
            if not 1e-15 < length < 1e15:
                self.stop(where, "the quaternion has no length")
                return None
            x, y, z, w = x / length, y / length, z / length, w / length
            return np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                ]
            )
        angles = self._vector(where, value, 0.0)
        if not any(angles):
            return None
        (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        turn: np.ndarray[Any, Any] = about_z @ about_y @ about_x
        return turn

    def _rows(self, where: str, value: Any) -> tuple[tuple[float, ...], ...] | None:
        rows = self._list(where, value)
        if len(rows) != 4 or any(not isinstance(row, list) or len(row) != 4 for row in rows):
            self.stop(where, "is not four rows of four numbers")
            return None
        found = [[self._number(f"{where}[{i}][{k}]", x) for k, x in enumerate(row)] for i, row in enumerate(rows)]
        right = [[x for x in row if x is not None] for row in found]
        if right != found:
            return None
        if right[3] != [0, 0, 0, 1]:
            self.stop(f"{where}[3]", "is not 0, 0, 0, 1")
            return None
        return tuple(tuple(row) for row in right)


def _implicit(shape: Shape, matrix: Any, material: Material, name: str) -> Callable[[], Implicit]:
    return lambda: Implicit(shape, matrix, material, name)


def _join(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def _shown(value: Any) -> str:
    if isinstance(value, (dict, list)):
        return "an object" if isinstance(value, dict) else "a list"
    return shorten(repr(value), 60)


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _tuples(item) for key, item in value.items()}
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _property_value(value: Any) -> Any:
    """S5 writes numbers as text: ``"0.618"``, ``"(0.5, 0.1, 0.5)"``."""
    if not isinstance(value, str):
        return value
    inner = re.fullmatch(r"\s*\(?([^()]*)\)?\s*", value)
    try:
        numbers = [float(part) for part in inner[1].split(",")] if inner else []
    except ValueError:
        numbers = []
    if not numbers:
        raise ParameterError(f"{shorten(repr(value))} is not a number or vector")
    return numbers[0] if len(numbers) == 1 else tuple(numbers)
