"""Writing of shapes as S5's JSON with its extensions; see ``docs/sdf-json.md``."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from tyndall.gpu.params import ParameterError, fields_of
from tyndall.scene.errors import SceneError
from tyndall.scene.files.atomic import atomic_write
from tyndall.scene.model import Implicit, Material
from tyndall.sdf.files.names import GROUP, is_data, type_names
from tyndall.sdf.files.reader import FIRST_ID, MOST_NODES
from tyndall.sdf.shading import FragmentShader, ShadedMaterial
from tyndall.sdf.shape import Combination, Named, Painted, Primitive, Shape, Transformed
from tyndall.sdf.snippets import Snippet, SnippetSource

MOST_LEVELS = 190  # of lists and objects within each other: readers of scene files give up at 200
_ON_ONE_LINE = {"x", "y", "z", "name", "type", "value", "data"}


def write_model(shape: Shape, path: Path, name: str) -> None:
    """See :func:`tyndall.sdf.files.save`."""
    writer = _Writer()
    try:
        node = writer.whole(shape)
        record = {"name": name, **writer.tables(), "model": node}
        text = f"{_text(record)}\n".encode()
    except (ParameterError, UnicodeEncodeError) as error:
        raise SceneError(
            path, "a name is not text that UTF-8 can hold" if isinstance(error, UnicodeError) else str(error)
        ) from error
    except RecursionError:
        raise SceneError(path, "the shape is nested too deeply") from None
    with atomic_write(path) as file:
        file.write(text)


def pack_objects(implicits: Sequence[Implicit]) -> dict[str, Any]:
    """See :func:`tyndall.sdf.files.pack`."""
    writer = _Writer()
    objects = []
    try:
        for implicit in implicits:
            shape: Any = implicit.shape
            objects.append(
                {
                    "name": implicit.name,
                    "transform": [list(row) for row in implicit.transform],
                    "material_id": writer.material(implicit.material),
                    "shape": writer.whole(shape),
                }
            )
    except RecursionError:
        raise ParameterError("implicits: a shape is nested too deeply") from None
    if _levels(objects) > MOST_LEVELS:
        raise ParameterError("implicits: a shape is nested too deeply for a scene file; sdf.save() writes it alone")
    return {**writer.tables(), "objects": objects}


def _levels(value: Any) -> int:
    """How deep lists and objects lie within each other."""
    levels, within = 0, [value]
    while within := [inner for outer in within for inner in _inside(outer)]:
        levels += 1
    return levels


def _inside(value: Any) -> Collection[Any]:
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


class _Writer:
    """Nodes, with the tables of what they refer to."""

    def __init__(self) -> None:
        self._materials: list[Any] = []
        self._shaders: dict[FragmentShader, int] = {}
        self._sources: dict[SnippetSource, int] = {}
        self._known: dict[int, tuple[int, Material]] = {}
        self._reserved: set[int] = set()

    def tables(self) -> dict[str, Any]:
        """The tables that are not empty."""
        tables = {
            "primitives": [{"name": s.name, "id": i, "code": s.text} for s, i in self._sources.items()],
            "shaders": [
                {"name": s.name, "properties": [p.text for p in s.properties], "code": s.text} for s in self._shaders
            ],
            "materials": self._materials,
        }
        return {name: table for name, table in tables.items() if table}

    # --- materials ---

    def material(self, material: Material) -> int:
        """The index of a material."""
        if id(material) not in self._known:
            record = self._material(material)
            self._materials.append(record)
            self._known[id(material)] = len(self._materials) - 1, material  # kept alive: ids stay unique
        return self._known[id(material)][0]

    def _material(self, material: Material) -> dict[str, Any]:
        record: dict[str, Any] = {}
        for f in fields_of(Material):
            value = getattr(material, f.name)
            if f.name.endswith("texture"):
                if value is not None:
                    raise ParameterError(f"{f.name}: an implicit surface has no textures")
            elif not _same(value, f.default) or f.name == "name":
                record[f.name] = value
        if not isinstance(material, ShadedMaterial):
            return record
        self._shaders.setdefault(material.shader, len(self._shaders))
        named = [s for s in self._shaders if s.name == material.shader.name]
        record["base_shader"] = material.shader.name if named[0] == material.shader else self._shaders[material.shader]
        record["properties"] = [
            {"name": p.name, "type": p.type, "value": _value_text(numbers, p.is_whole)}
            for p, numbers in zip(material.shader.properties, material.grouped, strict=True)
        ]
        if not material.lit:
            record["lit"] = False
        return record

    # --- nodes ---

    def whole(self, shape: Shape) -> dict[str, Any]:
        """The root of a shape."""
        if shape.count > MOST_NODES:
            raise ParameterError(f"shape: {shape.count} nodes; a file has at most {MOST_NODES}")
        return self.node(shape)

    def node(self, shape: Shape) -> dict[str, Any]:
        """A shape and all below it: its place, name and material are the node's where they are so nested."""
        around: dict[str, Any] = {}
        if isinstance(shape, Transformed):
            around["transform"], shape = transform(shape), shape.shape
        if isinstance(shape, Named):
            around["name"], shape = shape.name, shape.shape
        if isinstance(shape, Painted):
            around["material_id"], shape = self.material(shape.surface), shape.shape
        record = {**self._core(shape), **around}
        children = record.pop("children", None)
        return record if children is None else {**record, "children": children}

    def _core(self, shape: Shape) -> dict[str, Any]:
        if isinstance(shape, (Transformed, Named, Painted)):
            return {"type": GROUP, "children": [self.node(shape)]}
        if isinstance(shape, Combination):
            record: dict[str, Any] = {"type": f"Operations/{shape.operation.capitalize()}"}
            if not _same(shape.smooth, 0.0):
                record["factor"] = shape.smooth
            if shape.blend != "polynomial":
                record["blend"] = shape.blend
            return {**record, "children": [self.node(child) for child in shape.shapes]}
        if isinstance(shape, Snippet):
            return self._snippet(shape)
        kind = type_names().get(type(shape))
        if kind is None:
            raise ParameterError(f"{type(shape).__name__} has no form in JSON")
        if hasattr(shape, "to_data"):
            return {"type": kind, **shape.to_data()}
        return {"type": kind, **self._parameters(shape)}

    def _parameters(self, shape: Shape) -> dict[str, Any]:
        """Numbers of a primitive as S5's ``data``; all else, and an operation's numbers, by name."""
        declared = {f.name: f for f in fields_of(type(shape))}
        record: dict[str, Any] = {}
        numbers: list[float] = []
        for f in dataclasses.fields(shape):  # type: ignore[arg-type]
            value = getattr(shape, f.name)
            if f.name == "shape":
                record["children"] = [self.node(value)]
            elif f.name in declared and isinstance(shape, Primitive) and is_data(declared[f.name]):
                numbers += value if isinstance(value, tuple) else (value,)
            elif f.name in declared:
                record[f.name] = value
            elif not _same(value, f.default):
                record[f.name] = _plain(f"{type(shape).__name__}.{f.name}", value)
        if numbers:
            record["data"] = numbers
        return record

    def _snippet(self, shape: Snippet) -> dict[str, Any]:
        source = shape.source
        if source not in self._sources:
            taken = set(self._sources.values())
            number = source.id if source.id is not None and source.id not in taken else FIRST_ID
            while number in taken:
                number += 1
            self._sources[source] = number
        kind = f"Primitives/{source.name}"
        record: dict[str, Any] = {"type": kind}
        named = [s for s in self._sources if s.name == source.name]
        if named[0] != source or kind in type_names().values():
            record["id"] = self._sources[source]
        if shape.values:
            record["data"] = list(shape.values)
        if shape.slope != 1:
            record["lipschitz"] = shape.slope
        if any(math.isfinite(x) for x in (*shape.low, *shape.high)):
            record["box"] = [[x if math.isfinite(x) else None for x in side] for side in (shape.low, shape.high)]
        if shape.growth != 1:
            record["growth"] = shape.growth
        if shape.exact:
            record["exact"] = True
        return record


def _text(value: Any, margin: str = "\n") -> str:
    """JSON whose lists and vectors of plain values stay on one line."""
    inner = f"{margin}  "
    items = value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else ()
    flat = not any(isinstance(item, (dict, list, tuple)) for item in items)
    if flat and (not isinstance(value, dict) or set(value) <= _ON_ONE_LINE):
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    if isinstance(value, dict):
        members = (f"{json.dumps(key, ensure_ascii=False)}: {_text(item, inner)}" for key, item in value.items())
        return f"{{{inner}{f',{inner}'.join(members)}{margin}}}"
    return f"[{inner}{f',{inner}'.join(_text(item, inner) for item in value)}{margin}]"


def transform(shape: Transformed) -> dict[str, Any]:
    """S5's position and scale where these give the same matrix bit for bit, and else the matrix."""
    m = shape.matrix
    plain = all(_same(m[i][k], 0.0) for i in range(3) for k in range(3) if i != k)
    if not plain or any(m[i][i] == 0 for i in range(3)) or not _same(m[3], (0.0, 0.0, 0.0, 1.0)):
        return {"matrix": [list(row) for row in m]}
    record = {"position": dict(zip("xyz", (m[i][3] for i in range(3)), strict=True))}
    scale = [m[i][i] for i in range(3)]
    if scale != [1, 1, 1]:
        record["scale"] = dict(zip("xyz", scale, strict=True))
    return record


def _same(a: Any, b: Any) -> bool:
    """Equal, and of the same bits: −0.0 is not 0.0."""
    return bool(a == b) and repr(a) == repr(b)


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, (tuple, list)):
        return [_plain(name, item) for item in value]
    if value is None or isinstance(value, (bool, int, str)) or (isinstance(value, float) and math.isfinite(value)):
        return value
    raise ParameterError(f"{name}: {type(value).__name__} has no form in JSON")


def _value_text(numbers: tuple[float, ...], whole: bool) -> str:
    texts = [repr(int(x)) if whole else repr(x) for x in numbers]
    return texts[0] if len(texts) == 1 else f"({','.join(texts)})"
