"""The scene JSON: its contents are in ``docs/scene-format.md``, its validation in :mod:`tyndall.scene.files.schema`.

What is shared in memory is shared in the file: an image, texture, material, mesh or array that several others refer to
is written once. Numbers are written with as many digits as bring back the same bits.

The binary file is named after its content. So a scene that is saved again with another light rewrites a few kilobytes,
two scenes of the same name never take each other's geometry, and an interruption between the two files leaves the old
JSON with the old geometry. Binary files that no JSON refers to any more are left for their owner to delete.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError, fields_of
from tyndall.scene.errors import SceneError
from tyndall.scene.files.atomic import atomic_write
from tyndall.scene.files.source import beside, map_bytes
from tyndall.scene.model import Image, Implicit, Instance, Material, Mesh, Scene, Texture, Volume

VERSION = 1
# Who knows the JSON of implicit surfaces: a module with `pack`, `unpack` and `load_scene`, above this layer, that is
# imported where a file has any.
IMPLICITS = "tyndall.sdf.files"
_ALIGN = 16  # bytes; any view of the mapped file is aligned for its type and for vector loads


def codec() -> Any:
    """The module that reads and writes implicit surfaces."""
    return importlib.import_module(IMPLICITS)


# --- writing ------------------------------------------------------------------------------------------------------


class _Writer:
    """Gathers the records and arrays of a scene, each object once, by identity: equal is not the same (-0.0 = 0.0)."""

    def __init__(self) -> None:
        self.tables: dict[str, list[Any]] = {name: [] for name in ("images", "textures", "materials", "meshes")}
        self.arrays: list[NDArray[Any]] = []
        self.size = 0
        self._known: dict[int, Any] = {}
        self._alive: list[Any] = []  # ids stay unique only while the objects live

    def _once(self, thing: Any, make: Callable[[], Any]) -> Any:
        if id(thing) not in self._known:
            self._alive.append(thing)
            self._known[id(thing)] = make()
        return self._known[id(thing)]

    def _listed(self, table: str, thing: Any, record: Callable[[], dict[str, Any]]) -> int:
        def append() -> int:
            self.tables[table].append(record())
            return len(self.tables[table]) - 1

        index: int = self._once(thing, append)
        return index

    def _rows(self, array: NDArray[Any], count: int) -> dict[str, int]:
        def append() -> dict[str, int]:
            place = {"offset": self.size, "count": count}
            little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
            self.arrays.append(little)
            self.size += -(-little.nbytes // _ALIGN) * _ALIGN
            return place

        place: dict[str, int] = self._once(array, append)
        return place

    def value(self, value: Any) -> Any:
        """A declared value as JSON, references by index."""
        if isinstance(value, Texture):
            return self._listed("textures", value, lambda: self.parameters(value))
        if isinstance(value, Image):
            return self.image(value)
        if isinstance(value, tuple):
            return [self.value(item) for item in value]
        return self.parameters(value) if hasattr(value, "__dataclass_fields__") else value

    def parameters(self, thing: Any) -> dict[str, Any]:
        kind = {"kind": thing.kind} if hasattr(thing, "kind") else {}
        return {**kind, **{f.name: self.value(getattr(thing, f.name)) for f in fields_of(type(thing))}}

    def image(self, image: Image) -> int:
        height, width, _ = image.pixels.shape
        return self._listed(
            "images",
            image,
            lambda: {
                "name": image.name,
                "width": width,
                "height": height,
                "texels": self._rows(image.pixels, width * height),
            },
        )

    def mesh(self, mesh: Mesh) -> int:
        return self._listed(
            "meshes",
            mesh,
            lambda: {
                "name": mesh.name,
                "material": self._listed("materials", mesh.material, lambda: self.parameters(mesh.material)),
                **{
                    name: None if array is None else self._rows(array, len(array))
                    for name in ("positions", "normals", "uvs", "indices")
                    for array in (getattr(mesh, name),)
                },
            },
        )

    def chunks(self) -> list[memoryview]:
        """The binary file's bytes, in order."""
        chunks = []
        for array in self.arrays:
            chunks.append(memoryview(array.reshape(-1).view(np.uint8)))
            chunks.append(memoryview(bytes(-array.nbytes % _ALIGN)))
        return chunks


def save(scene: Scene, path: Path) -> None:
    """Write ``path`` and its binary file. See :func:`tyndall.scene.files.save`."""
    writer = _Writer()
    instances = [
        {"name": i.name, "mesh": writer.mesh(i.mesh), "transform": [list(row) for row in i.transform]}
        for i in scene.instances
    ]
    chunks = writer.chunks()
    data = None
    if chunks:
        digest = hashlib.blake2b(digest_size=8)
        for chunk in chunks:
            digest.update(chunk)
        data = f"{re.sub(r'[^\w.-]', '_', path.stem)}-{digest.hexdigest()}.bin"
    record = {
        "version": VERSION,
        "name": scene.name,
        "camera": writer.parameters(scene.camera),
        "lights": [writer.parameters(light) for light in scene.lights],
        "medium": writer.parameters(scene.medium),
        "background": scene.background,
        "ambient": scene.ambient,
        "looks": scene.looks,
        "data": data,
        **writer.tables,
        "instances": instances,
    }
    if scene.implicits or scene.volumes:
        try:
            if scene.implicits:
                record["implicits"] = codec().pack(scene.implicits)
            if scene.volumes:
                record["volumes"] = {
                    "surfaces": codec().pack([volume.surface for volume in scene.volumes]),
                    "media": [writer.parameters(volume.medium) for volume in scene.volumes],
                    "edges": [volume.edge for volume in scene.volumes],
                }
        except ParameterError as error:
            raise SceneError(path, str(error)) from error
    wrong: list[str] = []
    plain = _plain(record, "", wrong)
    if wrong:
        raise SceneError(path, wrong)
    try:
        text = f"{_text(plain)}\n".encode()
    except UnicodeEncodeError as error:
        raise SceneError(path, "a name in the scene is not text that UTF-8 can hold") from error

    if data is not None:
        binary = path.with_name(data)
        if not (binary.is_file() and binary.stat().st_size == writer.size):
            with atomic_write(binary) as file:
                for chunk in chunks:
                    file.write(chunk)
    with atomic_write(path) as file:
        file.write(text)


def _plain(value: Any, where: str, wrong: list[str]) -> Any:
    """``value`` with only what JSON knows; what it does not know is added to ``wrong``."""
    if isinstance(value, Mapping):
        step = f"{where}." if where else ""
        return {str(key): _plain(item, f"{step}{key}", wrong) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist(), where, wrong)
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{where}[{i}]", wrong) for i, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        wrong.append(f"{where}: {value} is not a finite number")
    elif value is not None and not isinstance(value, (bool, int, float, str)):
        wrong.append(f"{where}: {type(value).__name__} is nothing that JSON can hold")
    return value


def _text(value: Any, margin: str = "\n") -> str:
    """JSON whose lists of plain values, rows of a matrix among them, stay on one line."""
    inner = f"{margin}  "
    if isinstance(value, dict) and value:
        members = (f"{json.dumps(key, ensure_ascii=False)}: {_text(item, inner)}" for key, item in value.items())
        return f"{{{inner}{f',{inner}'.join(members)}{margin}}}"
    if isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        return f"[{inner}{f',{inner}'.join(_text(item, inner) for item in value)}{margin}]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


# --- reading ------------------------------------------------------------------------------------------------------


def load(path: Path) -> Scene:
    """Read ``path`` and its binary file. See :func:`tyndall.scene.files.load`."""
    import pydantic

    from tyndall.scene.files import schema

    raw = path.read_bytes()
    try:
        data = schema.parse(raw)
    except ValueError as error:
        raise SceneError(path, f"not JSON: {error}") from error
    if not isinstance(data, dict):
        raise SceneError(path, "not a scene: a JSON object is expected")
    if "version" not in data and not {"scene", "model", "code", "base_shader"}.isdisjoint(data):
        implicit: Scene = codec().load_scene(path)
        return implicit

    wrong: list[str] = []
    filled = data.get("volumes")
    surfaces = filled.get("surfaces") if isinstance(filled, dict) else None
    packed = {"implicits": data.get("implicits"), "volumes": surfaces}
    objects: dict[str, tuple[Implicit, ...]] = {"implicits": (), "volumes": ()}
    for key, described in packed.items():
        if described is not None:
            try:
                objects[key] = codec().unpack(path, described, raw.decode("utf-8"))
            except SceneError as error:
                wrong += error.mistakes
    binary: NDArray[np.uint8] | None = None
    if isinstance(data.get("data"), str):
        try:
            binary = map_bytes(beside(path, data["data"]))
        except SceneError as error:
            wrong.append(f"data: '{data['data']}': {error.mistakes[0]}")
        except ValueError as error:
            wrong.append(f"data: {error}")
    elif any(data.get(table) for table in ("images", "meshes")) and data.get("data") is None:
        wrong.append("data: is missing, and images or meshes need it")
    lengths = {name: len(rows) for name, rows in data.items() if isinstance(rows, list)}
    for table in ("images", "textures", "materials", "meshes"):
        if table not in data:
            lengths[table] = 0
    extent = schema.Extent(lengths, None if binary is None else binary.size)
    wrong += [f"{where}: {value} is not a finite number" for where, value in _not_finite(data.get("looks"), ("looks",))]
    try:
        record = schema.SceneRecord.model_validate_json(raw, context=extent)
    except pydantic.ValidationError as error:
        wrong += schema.mistakes(error, data)
    if wrong:
        raise SceneError(path, wrong)
    scene = _build(path, record, np.zeros(0, np.uint8) if binary is None else binary)
    return scene.with_(implicits=objects["implicits"], volumes=_volumes(path, record.volumes, objects["volumes"]))


def _volumes(path: Path, record: Any, surfaces: tuple[Implicit, ...]) -> list[Volume]:
    if record is None:
        return []
    if not len(surfaces) == len(record.media) == len(record.edges):
        raise SceneError(
            path, f"volumes: {len(surfaces)} surfaces, {len(record.media)} media and {len(record.edges)} edges"
        )
    try:
        return [
            Volume(surface.shape, medium, surface.transform, edge, surface.name)
            for surface, medium, edge in zip(surfaces, record.media, record.edges, strict=True)
        ]
    except ParameterError as error:
        raise SceneError(path, f"volumes: {error}") from error


def _not_finite(value: Any, loc: tuple[Any, ...]) -> list[tuple[str, float]]:
    from tyndall.scene.files.schema import path_text

    if isinstance(value, float) and not math.isfinite(value):
        return [(path_text(loc), value)]
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, item in items for found in _not_finite(item, (*loc, key))]


def _build(path: Path, record: Any, binary: NDArray[np.uint8]) -> Scene:
    from tyndall.scene.files.schema import build, references

    arrays: dict[tuple[int, int, str], NDArray[Any]] = {}

    def rows(place: Any, dtype: str, width: int) -> NDArray[Any]:
        key = (place.offset, place.count, dtype)
        if key not in arrays:
            end = place.offset + place.count * width * np.dtype(dtype).itemsize
            arrays[key] = binary[place.offset : end].view(dtype).reshape(place.count, width)
        return arrays[key]

    images = [Image(rows(i.texels, "u1", 4).reshape(i.height, i.width, 4), i.name) for i in record.images]
    tables: dict[str, list[Any]] = {"images": images, "textures": [], "materials": []}

    def resolved(cls: type, r: Any) -> Any:
        links = {name: (getattr(r, name), table) for name, table in references(cls).items()}
        return build(cls, r, **{n: None if i is None else tables[table][i] for n, (i, table) in links.items()})

    tables["textures"] += [resolved(Texture, t) for t in record.textures]
    tables["materials"] += [resolved(Material, m) for m in record.materials]
    meshes, wrong = [], []
    for index, m in enumerate(record.meshes):
        try:
            meshes.append(
                Mesh(
                    positions=rows(m.positions, "<f4", 3),
                    indices=rows(m.indices, "<u4", 3),
                    normals=rows(m.normals, "<f4", 3),
                    uvs=None if m.uvs is None else rows(m.uvs, "<f4", 2),
                    material=tables["materials"][m.material],
                    name=m.name,
                )
            )
        except ParameterError as error:
            wrong.append(f"meshes[{index}].{error}")
    if wrong:
        raise SceneError(path, wrong)
    return Scene(
        instances=tuple(Instance(meshes[i.mesh], i.transform, i.name) for i in record.instances),
        lights=record.lights,
        camera=record.camera,
        medium=record.medium,
        background=record.background,
        ambient=record.ambient,
        looks={name: {key: _tuples(value) for key, value in look.items()} for name, look in record.looks.items()},
        name=record.name,
    )


def _tuples(value: Any) -> Any:
    """JSON's lists as tuples, which is what the parameters of techniques are."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
