"""The scene JSON brings back the same bits, and tells every mistake of a file at once."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import struct
from pathlib import Path
from types import UnionType
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import tyndall.scene
from tyndall.gpu.params import Field, ParameterError, describe_range, fields_of
from tyndall.scene.errors import SceneError
from tyndall.scene.files import load, save, scene_schema
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    HenyeyGreenstein,
    Image,
    Instance,
    Light,
    Material,
    Medium,
    Mesh,
    Phase,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
    Texture,
)

DOCS = Path(tyndall.scene.__file__).parents[3] / "docs" / "scene-format.md"

# --- random scenes, generated from the same declarations as the file format ---------------------------------------


def values(f: Field, tp: Any) -> st.SearchStrategy[Any]:
    """Values of a declared type inside the declared range, ends and tiny numbers included."""
    origin, args = get_origin(tp), get_args(tp)
    if origin is UnionType:
        return st.one_of(*(values(f, a) for a in args))
    if origin is tuple:
        return st.tuples(*(values(f, a) for a in args))
    if origin is Literal:
        return st.sampled_from(args)
    if tp is bool:
        return st.booleans()
    if tp is str:
        return st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
    if tp is type(None):
        return st.none()
    if tp is float:
        low = -1e30 if f.param.low is None else f.param.low
        high = 1e30 if f.param.high is None else f.param.high
        return st.floats(low, high, allow_nan=False)
    if dataclasses.is_dataclass(tp):
        return instances_of(tp)
    raise AssertionError(f"{f.name}: no strategy for {tp}")


IMAGES = st.builds(
    lambda shape, seed, name: Image(np.random.default_rng(seed).integers(0, 256, (*shape, 4), np.uint8), name),
    st.tuples(st.integers(1, 4), st.integers(1, 4)),
    st.integers(0, 99),
    st.text("ab é", max_size=3),
)


def instances_of(cls: Any) -> st.SearchStrategy[Any]:
    """Instances of a declared dataclass; combinations that it refuses itself are drawn again."""
    if cls is Image:
        return IMAGES

    def make(given: dict[str, Any]) -> Any:
        try:
            return cls(**given)
        except ParameterError:
            return None

    fields = {f.name: values(f, f.type) for f in fields_of(cls)}
    return st.fixed_dictionaries(fields).map(make).filter(lambda made: made is not None)


def _mesh(positions: list[float], uvs: bool, material: Material, name: str) -> Mesh:
    points = np.array(positions, np.float32).reshape(-1, 3)
    count = len(points)
    corners = np.arange(count, dtype=np.uint32).reshape(-1, 3)
    coordinates = points[:, :2] / np.float32(3) if uvs else None
    return Mesh(points, corners, np.tile(np.float32((0, 1, 0)), (count, 1)), coordinates, material, name)


FLOAT32 = st.floats(-1e10, 1e10, width=32)
MESHES = st.builds(
    _mesh,
    st.lists(FLOAT32, min_size=9, max_size=9) | st.lists(FLOAT32, min_size=18, max_size=18),
    st.booleans(),
    instances_of(Material),
    st.text("xyz", max_size=3),
)
MATRICES = st.lists(st.floats(-1e6, 1e6), min_size=16, max_size=16).map(lambda m: np.reshape(m, (4, 4)))
LOOKS = st.dictionaries(
    st.sampled_from(["froxel", "march", "polygonal"]),
    st.dictionaries(
        st.text("abc_", min_size=1, max_size=4),
        st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-9, 9) | st.text("ab", max_size=3)
        | st.tuples(st.integers(0, 9), st.floats(0, 1)),
        max_size=3,
    ),
    max_size=2,
)  # fmt: skip
VEC3 = st.tuples(*[st.floats(0, 10)] * 3)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    meshes = draw(st.lists(MESHES, max_size=2))
    placed = [Instance(mesh, draw(MATRICES), "i") for mesh in meshes for _ in range(draw(st.integers(1, 2)))]
    return Scene(
        tuple(placed),
        tuple(draw(st.lists(st.one_of(*map(instances_of, get_args(Light))), max_size=3))),
        draw(instances_of(Camera)),
        draw(instances_of(Medium)),
        draw(VEC3),
        draw(VEC3),
        draw(LOOKS),
        draw(st.text("ab cé", max_size=5)),
    )


def bits(thing: Any) -> Any:
    """Everything in a scene down to the bit, with sharing shown: an object seen before is its number."""
    seen: dict[int, int] = {}

    def walk(value: Any) -> Any:
        if isinstance(value, float):
            return struct.pack("<d", value)
        if isinstance(value, np.ndarray):
            shared = seen.setdefault(id(value), len(seen))
            return shared, value.dtype.str, value.shape, value.tobytes()
        if dataclasses.is_dataclass(value):
            number = seen.setdefault(id(value), len(seen)) if isinstance(value, (Mesh, Image)) else None
            fields = {f.name: walk(getattr(value, f.name)) for f in dataclasses.fields(value)}
            return type(value).__name__, number, fields
        if isinstance(value, dict):
            return {key: walk(item) for key, item in value.items()}
        return [walk(item) for item in value] if isinstance(value, (tuple, list)) else value

    return walk(thing)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(scenes())
def test_what_was_saved_comes_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, scene: Scene) -> None:
    path = tmp_path_factory.mktemp("scene") / "a.json"
    save(scene, path)
    first = path.read_bytes()
    loaded = load(path)
    assert bits(loaded) == bits(scene)
    save(loaded, path)
    assert path.read_bytes() == first


def test_every_kind_of_light_and_phase_is_drawn_above() -> None:
    assert {c.__name__ for c in get_args(Light)} == {"DirectionalLight", "PointLight", "SpotLight", "RectLight"}
    assert len(get_args(Phase)) == 5
    phase = next(f for f in fields_of(Medium) if f.name == "phase")
    assert set(get_args(phase.type)) == set(get_args(Phase))


# --- one scene with everything shared that can be -----------------------------------------------------------------


@pytest.fixture
def scene() -> Scene:
    image = Image(np.arange(5 * 3 * 4, dtype=np.uint8).reshape(5, 3, 4), "checks")
    texture = Texture(image, wrap_u="mirror", scale=(0.1, 2 / 3))
    material = Material("paint", base_color_texture=texture, emissive_texture=texture, emissive=(1 / 3, 0, 1e-30))
    other = Material("gloss", base_color_texture=Texture(image), roughness=0.1)
    positions = np.array([(-1, 0, 0), (1, 0, 0), (0, 2, -0.0), (0, 0, 1)], np.float32)
    first = Mesh(positions, np.array([(0, 1, 2), (0, 2, 3)]), material=material)
    second = Mesh(first.positions, np.array([(1, 3, 2)]), first.normals, positions[:, :2], other)
    return Scene(
        (Instance(first), Instance(first, np.diag((1, 2, 3, 1))), Instance(second)),  # type: ignore[arg-type]
        (SpotLight((0, 3, 0), intensity=30), PointLight((1, 1, 1)), DirectionalLight((0, -1, 0.5)), RectLight(width=2)),
        medium=Medium((0.1,) * 3, (0.2,) * 3, HenyeyGreenstein(0.5), ((-3, -3, -3), (3, 3, 3))),
        looks={"froxel": {"grid": (16, 9, 8)}},
    )


def test_what_is_shared_in_memory_is_shared_in_the_file(scene: Scene, tmp_path: Path) -> None:
    save(scene, tmp_path / "a.json")
    record = json.loads((tmp_path / "a.json").read_text())
    counts = {name: len(record[name]) for name in ("images", "textures", "materials", "meshes", "instances")}
    assert counts == {"images": 1, "textures": 2, "materials": 2, "meshes": 2, "instances": 3}
    assert record["meshes"][0]["positions"] == record["meshes"][1]["positions"]
    first, again, second = (i.mesh for i in load(tmp_path / "a.json").instances)
    assert first is again
    assert first.positions is second.positions
    image = first.material.base_color_texture.image  # type: ignore[union-attr]
    assert image is second.material.base_color_texture.image  # type: ignore[union-attr]
    assert first.material.base_color_texture is first.material.emissive_texture


def test_the_picture_of_a_saved_scene_is_the_same(scene: Scene, tmp_path: Path) -> None:
    from tyndall.frame import Renderer
    from tyndall.gpu.device import Gpu

    save(scene, tmp_path / "a.json")
    pictures = []
    with Gpu() as gpu:
        for variant in (scene, load(tmp_path / "a.json")):
            with Renderer(variant, (48, 32), gpu=gpu) as renderer:
                renderer.draw()
                pictures.append((renderer.radiance(), renderer.inscattered(), renderer.depth()))
    assert np.isfinite(pictures[0][2]).any()  # something is seen
    for before, after in zip(*pictures, strict=True):
        assert before.tobytes() == after.tobytes()


def test_loading_maps_the_geometry_and_protects_it(scene: Scene, tmp_path: Path) -> None:
    save(scene, tmp_path / "a.json")
    mesh = load(tmp_path / "a.json").instances[0].mesh
    with pytest.raises(ValueError, match="read-only"):
        mesh.positions[0] = 0


# --- writing ------------------------------------------------------------------------------------------------------


def test_an_interruption_leaves_the_old_scene_and_nothing_else(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.json"
    save(scene, path)
    before, names = bits(load(path)), sorted(p.name for p in tmp_path.iterdir())

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    changed = scene.with_(instances=scene.instances[2:])
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupt)
        with pytest.raises(KeyboardInterrupt):
            save(changed, path)
    assert sorted(p.name for p in tmp_path.iterdir()) == names
    assert bits(load(path)) == before

    replace, calls = os.replace, []

    def interrupt_the_second(source: Any, target: Any) -> None:
        calls.append(target)
        if len(calls) == 2:
            raise KeyboardInterrupt
        replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupt_the_second)
        with pytest.raises(KeyboardInterrupt):
            save(changed, path)
    assert bits(load(path)) == before
    assert not list(tmp_path.glob(".*"))


def test_a_changed_light_rewrites_no_geometry(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    save(scene, path)
    (binary,) = tmp_path.glob("*.bin")
    stamp = binary.stat().st_mtime_ns
    save(load(path).with_(lights=()), path)
    assert [binary] == list(tmp_path.glob("*.bin"))
    assert binary.stat().st_mtime_ns == stamp
    assert load(path).lights == ()


def test_what_json_cannot_hold_is_refused_before_anything_is_written(scene: Scene, tmp_path: Path) -> None:
    odd = scene.with_(looks={"froxel": {"grid": (1, math.inf), "what": object()}})
    with pytest.raises(SceneError) as caught:
        save(odd, tmp_path / "a.json")
    assert caught.value.mistakes == (
        "looks.froxel.grid[1]: inf is not a finite number",
        "looks.froxel.what: object is nothing that JSON can hold",
    )
    with pytest.raises(SceneError, match="a scene is saved as .json"):
        save(scene, tmp_path / "a.glb")
    with pytest.raises(SceneError, match="cannot be written"):
        save(scene, tmp_path / "missing" / "a.json")
    assert not list(tmp_path.iterdir())


def test_a_scene_without_geometry_is_one_file_of_any_name(tmp_path: Path) -> None:
    save(Scene(), tmp_path / "a.json")
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
    assert bits(load(tmp_path / "a.json")) == bits(Scene())


def test_awkward_names_are_no_trouble(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "c:a b é.json"
    save(scene, path)
    assert bits(load(path)) == bits(scene)


# --- mistakes -----------------------------------------------------------------------------------------------------

# Where in the file, what is put there, and the line that must come of it.
MISTAKES: list[tuple[str, Any, str]] = [
    ("lights.0.intensity", -1, "lights[0].intensity: -1 is outside ≥ 0"),
    ("lights.1.radius", -0.5, "lights[1].radius: -0.5 is outside ≥ 0"),
    ("lights.2.angular_diameter", 4, "lights[2].angular_diameter: 4 is outside 0 … 3"),
    ("lights.1.intensty", 3, "lights[1].intensty: no such field — did you mean 'intensity'?"),
    ("lights.1.position", [0, "x", 0], "lights[1].position[1]: 'x' is not a number"),
    ("lights.1.color", [1, 1], "lights[1].color[2]: is missing"),
    ("lights.2.kind", "directonal", "lights[2].kind: 'directonal' is not one of 'directional', 'point', 'spot', 'rect'"
                                    " — did you mean 'directional'?"),
    ("lights.2.direction", [0, 0, 0], "lights[2].direction: (0, 0, 0) is no direction"),
    ("lights.0.inner_angle", 1.0, "lights[0].inner_angle: 1 is not below outer_angle, 0.785398"),
    ("lights.3.width", 0, "lights[3].width: 0 is outside ≥ 1e-06"),
    ("lights.3.direction", [0, 0, 0], "lights[3].direction: (0, 0, 0) is no direction"),
    ("lights.3.radius", 1, "lights[3].radius: no such field"),
    ("lights.0", 3, "lights[0]: 3 is not an object"),
    ("lights.0", {}, "lights[0].kind: is missing"),
    ("lights", {}, "lights: an object is not a list"),
    ("medium.scattering", [1, True, 1], "medium.scattering[1]: True is not a number"),
    ("medium.phase.g", 2, "medium.phase.g: 2 is outside -0.99 … 0.99"),
    ("medium.phase.kind", 7, "medium.phase.kind: 7 is not one of 'isotropic', 'henyey_greenstein', 'rayleigh', "
                             "'gibbons', 'schlick'"),
    ("medium.bounds", [[0, 0, 0], [1, 0, 1]], "medium.bounds: the upper corner (1.0, 0.0, 1.0) is not above the lower"
                                              " (0.0, 0.0, 0.0)"),
    ("camera.fov", math.nan, "camera.fov: nan is not a finite number"),
    ("camera.near", math.inf, "camera.near: inf is not a finite number"),
    ("camera.up", [0, 1e999, 0], "camera.up[1]: inf is not a finite number"),
    ("background", [0, 0, 0, 0], "background: has 4 items, not 3"),
    ("background", [0, -1, 0], "background[1]: -1 is outside ≥ 0"),
    ("background", [0, 0, math.nan], "background[2]: nan is not a finite number"),
    ("version", 2, "version: 2 is not 1, the version that this Tyndall reads"),
    ("ambeint", 1, "ambeint: no such field — did you mean 'ambient'?"),
    ("looks.froxel", 3, "looks.froxel: 3 is not an object"),
    ("looks.froxel.deep", [1, [2, math.inf]], "looks.froxel.deep[1][1]: inf is not a finite number"),
    ("textures.0.wrap_u", "repeet", "textures[0].wrap_u: 'repeet' is not one of 'repeat', 'clamp', 'mirror'"
                                    " — did you mean 'repeat'?"),
    ("textures.0.image", 7, "textures[0].image: 7 is beyond the last of 1 images"),
    ("materials.0.base_color_texture", -1, "materials[0].base_color_texture: -1 is outside ≥ 0"),
    ("materials.0.double_sided", "yes", "materials[0].double_sided: 'yes' is not true or false"),
    ("images.0.width", 4, "images[0]: 15 texels are not 4 × 5"),
    ("meshes.0.material", "paint", "meshes[0].material: 'paint' is not a whole number"),
    ("meshes.1.positions.count", 10**9, "meshes[1].positions: ends at byte 12000000064, beyond the 240 bytes of the "
                                        "binary file"),
    ("meshes.1.normals.offset", -4, "meshes[1].normals.offset: -4 is outside ≥ 0"),
    ("meshes.1.normals.offset", 2, "meshes[1].normals.offset: 2 is not a multiple of 4"),
    ("instances.0.mesh", 1.5, "instances[0].mesh: 1.5 is not a whole number"),
    ("instances.0.mesh", 2, "instances[0].mesh: 2 is beyond the last of 2 meshes"),
    ("instances.1.transform", [[1, 0], [0, 1]], "instances[1].transform[0][2]: is missing"),
    ("data", "../a.bin", "data: '../a.bin' is refused: it is outside the folder of the scene"),
    ("data", "/etc/passwd", "data: '/etc/passwd' is refused: only files in the folder of the scene are read"),
    ("data", "http://x/y", "data: 'http://x/y' is refused: only files in the folder of the scene are read"),
    ("data", "none.bin", "data: 'none.bin': no such file"),
    ("data", None, "data: is missing, and images or meshes need it"),
]  # fmt: skip


def put(record: Any, where: str, value: Any) -> None:
    *steps, last = where.split(".")
    for step in steps:
        record = record[int(step) if isinstance(record, list) else step]
    record[int(last) if isinstance(record, list) else last] = value


@pytest.mark.parametrize(("where", "value", "line"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_is_one_line_with_its_path(scene: Scene, tmp_path: Path, where: str, value: Any, line: str) -> None:
    path = tmp_path / "a.json"
    save(scene, path)
    record = json.loads(path.read_text())
    put(record, where, value)
    path.write_text(json.dumps(record))
    with pytest.raises(SceneError) as caught:
        load(path)
    assert line in caught.value.mistakes
    assert f"{path}: {line}" in str(caught.value).splitlines()
    assert len(caught.value.mistakes) == 1 or where in ("instances.1.transform",)


def test_all_mistakes_are_reported_at_once(scene: Scene, tmp_path: Path) -> None:
    chosen = [m for m in MISTAKES if m[0] in ("lights.0.intensity", "lights.1.intensty", "camera.fov", "ambeint",
                                              "medium.bounds", "textures.0.image", "instances.0.mesh")]  # fmt: skip
    chosen = list({where: (where, value, line) for where, value, line in chosen}.values())
    path = tmp_path / "a.json"
    save(scene, path)
    record = json.loads(path.read_text())
    for where, value, _ in chosen:
        put(record, where, value)
    path.write_text(json.dumps(record))
    with pytest.raises(SceneError) as caught:
        load(path)
    assert set(caught.value.mistakes) == {line for _, _, line in chosen}


def test_geometry_that_lies_is_told_by_mesh(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    save(scene, path)
    (binary,) = tmp_path.glob("*.bin")
    record = json.loads(path.read_text())
    data = bytearray(binary.read_bytes())
    data[record["meshes"][1]["indices"]["offset"]] = 4
    at = record["meshes"][0]["positions"]["offset"]
    data[at : at + 4] = struct.pack("<f", math.nan)
    binary.write_bytes(data)
    with pytest.raises(SceneError) as caught:
        load(path)
    assert caught.value.mistakes == (
        "meshes[0].positions: a position is not finite",
        "meshes[1].positions: a position is not finite",
    )
    data[at : at + 4] = struct.pack("<f", 0)
    binary.write_bytes(data)
    with pytest.raises(SceneError, match=r"meshes\[1\].indices: 4 is beyond the last of 4 vertices"):
        load(path)
    binary.write_bytes(data[:-16])
    with pytest.raises(SceneError, match="beyond the"):
        load(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "not JSON"),
        (b"\xff\xfe{}", "not JSON"),
        (b'{"version": 1, "name": "\xff"}', "not JSON"),
        (b'{"version": 1', "not JSON"),
        (b"[1]", "not a scene: a JSON object is expected"),
        (b"null", "not a scene: a JSON object is expected"),
        (b'{"a":' * 100_000, "not JSON: recursion limit exceeded"),
        (b'{"version": 1, "lights": ' + b"[" * 5000 + b"]" * 5000 + b"}", "recursion limit"),
        (b'{"version": 1' + b"0" * 5000 + b"}", "number out of range"),
        (b"{}", "version: is missing"),
    ],
    ids=range(10),
)
def test_what_is_no_scene_is_one_line(tmp_path: Path, text: bytes, message: str) -> None:
    (tmp_path / "a.json").write_bytes(text)
    with pytest.raises(SceneError) as caught:
        load(tmp_path / "a.json")
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 400


def test_a_flood_of_mistakes_is_cut(tmp_path: Path) -> None:
    lights = [{"kind": "point", "intensity": -1}] * 1000
    (tmp_path / "a.json").write_text(json.dumps({"version": 1, "lights": lights}))
    with pytest.raises(SceneError) as caught:
        load(tmp_path / "a.json")
    assert len(caught.value.mistakes) == 51
    assert caught.value.mistakes[-1] == "and 950 more mistakes"


# --- the schema and its description -------------------------------------------------------------------------------


def test_the_schema_says_what_the_declarations_say() -> None:
    definitions = scene_schema()["$defs"]
    for cls in (*get_args(Light), *get_args(Phase), Medium, Camera, Material, Texture):
        properties = definitions[cls.__name__]["properties"]
        declared = {f.name for f in fields_of(cls)} | ({"kind"} if hasattr(cls, "kind") else set())
        assert set(properties) == declared
        for f in fields_of(cls):
            assert properties[f.name]["description"] == f.param.doc
            assert properties[f.name].get("unit", "") == f.param.unit
    fov = definitions["Camera"]["properties"]["fov"]
    (param,) = (f.param for f in fields_of(Camera) if f.name == "fov")
    assert describe_range(param) == f"{fov['minimum']:g} … {fov['maximum']:g}"


def test_the_example_in_the_docs_is_a_scene(tmp_path: Path) -> None:
    if not DOCS.exists():
        pytest.skip("an installed package has no docs folder")
    text = DOCS.read_text()
    example = text.partition("```json\n")[2].partition("```")[0]
    (tmp_path / "a.json").write_text(example)
    scene = load(tmp_path / "a.json")
    assert scene.lights


def row(f: Field) -> str:
    """The line of a field in the docs' tables."""
    default = "required" if f.default is dataclasses.MISSING else shown(f.default)
    bounds = describe_range(f.param) if float in kinds(f.type) else ""
    unit = f", {f.param.unit}" if f.param.unit else ""
    return f"| `{f.name}` | {form(f.type)} | {'' if bounds == 'any' else bounds} | {default} | {f.param.doc}{unit} |"


def shown(value: Any) -> str:
    if dataclasses.is_dataclass(value):
        return f'`{{"kind": "{value.kind}"}}`'  # type: ignore[union-attr]
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        return f"[{', '.join(shown(item) for item in value)}]"
    return {None: "null", True: "true", False: "false"}[value] if not isinstance(value, str) else f'"{value}"'


def kinds(tp: Any) -> set[Any]:
    return {tp}.union(*(kinds(a) for a in get_args(tp) if not isinstance(a, str)))


def form(tp: Any) -> str:
    origin, args = get_origin(tp), get_args(tp)
    if origin is UnionType:
        if all(dataclasses.is_dataclass(a) for a in args):
            return "phase function"
        return " or ".join(form(a) for a in args)
    if origin is Literal:
        return ", ".join(f'"{a}"' for a in args)
    if origin is tuple:
        return f"{len(args)} numbers" if args[0] is float else f"{len(args)} × {form(args[0])}"
    names = {float: "number", bool: "true, false", str: "text", type(None): "null"}
    return names.get(tp) or f"index into `{tp.__name__.lower()}s`"


@pytest.mark.parametrize("cls", [Camera, *get_args(Light), Medium, *get_args(Phase), Material, Texture])
def test_the_docs_have_every_declared_field(cls: type) -> None:
    if not DOCS.exists():
        pytest.skip("an installed package has no docs folder")
    lines = DOCS.read_text().splitlines()
    missing = [row(f) for f in fields_of(cls) if row(f) not in lines]
    assert not missing, "docs/scene-format.md lacks:\n" + "\n".join(missing)
