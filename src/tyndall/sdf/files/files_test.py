"""S5's JSON means what the document says, comes back bit for bit, and tells every mistake where it stands."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any, get_args, get_origin

import numpy as np
import pytest

import tyndall
from tyndall import sdf
from tyndall.gpu.params import Field, ParameterError, fields_of
from tyndall.scene.errors import SceneError
from tyndall.scene.model import DirectionalLight, Implicit, Material, Medium, Scene, Volume
from tyndall.sdf.files import load, save
from tyndall.sdf.files.names import GROUP, OPERATIONS, node_classes
from tyndall.sdf.files.places import parse, places
from tyndall.sdf.grid import Grid
from tyndall.sdf.shading import FragmentShader, ShadedMaterial, described
from tyndall.sdf.shape import Combination, Floats, Named, Painted, Primitive, Shape, Transformed, rotation
from tyndall.sdf.snippets import Snippet, SnippetKind, SnippetSource

POINTS = np.random.default_rng(11).uniform(-1, 1, (50, 3))

# --- the document's examples, its code in WGSL; line ends inside of texts are the document's own --------------------

HEX_PRISM = """{
  "name": "HexPrism",
  "id": 33,
  "code": "
fn sdHexPrism(place: vec3f, primitive: Primitive3D) -> f32 {
  let h = vec2f(primitive.data[0], primitive.data[1]);
  let k = vec3f(-0.8660254, 0.5, 0.57735);
  var p = abs(place);
  p -= vec3f(2.0 * min(dot(k.xy, p.xy), 0.0) * k.xy, 0.0);
  let d = vec2f(
    length(p.xy - vec2f(clamp(p.x, -k.z * h.x, k.z * h.x), h.x)) * sign(p.y - h.x), p.z - h.y);
  return min(max(d.x, d.y), 0.0) + length(max(d, vec2f(0.0)));
}"
}"""
BLEND_SHADER = """{
  "name": "Blend Shader",
  "properties": ["[float3] _Color1", "[float3] _Color2", "[float] [Range(0, 1)] _Blend"],
  "code": "
fn shade(properties: FragmentProperties) -> vec3f {
  return mix(_Color1, _Color2, _Blend);
}"
}"""
BLEND_MATERIAL = """{
  "base_shader": "Blend Shader",
  "properties": [
    { "name": "_Color1", "type": "float3", "value": "(0.5,0.1,0.5)" },
    { "name": "_Color2", "type": "float3", "value": "(0.2,0.7,0.6)" },
    { "name": "_Blend", "type": "float", "value": "0.61803398874" }
  ]
}"""
SPHERE = """{
  "name": "Esfera",
  "materials": ["blend_material"],
  "model": {
    "type": "Primitives/Sphere",
    "data": [0.5],
    "transform": {
      "position": { "x": 0.3, "y": 0.2, "z": 0.0 },
      "rotation": { "x": 0.0, "y": 0.0, "z": 0.0 },
      "scale": { "x": 1.0, "y": 2.0, "z": 4.0 }
    },
    "material_id": 0,
    "children": []
  }
}"""
THREE = """{
  "name": "TresEsferas",
  "materials": ["blend_material1", "blend_material2"],
  "model": {
    "type": "Operations/Union",
    "material_id": 0,
    "children": [
      { "type": "Primitives/Sphere", "data": [0.5],
        "transform": { "position": { "x": 0.3, "y": 0.2, "z": 0.0 } } },
      { "type": "Primitives/Sphere", "data": [0.5], "material_id": 1,
        "transform": { "position": { "x": 0.1, "y": 0.4, "z": 0.0 } } },
      { "type": "Primitives/Sphere", "data": [0.5],
        "transform": { "position": { "x": 0.3, "y": 0.1, "z": 0.0 } } }
    ]
  }
}"""
SCENE = """{
  "name": "Cena1",
  "scene": [
    { "type": "Operations/Union",
      "children": [{ "model": "Models/TresEsferas" }, { "model": "Models/Esfera" }],
      "transform": { "position": { "x": -0.8, "y": 0.0, "z": 0.0 } } }
  ]
}"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    other = BLEND_MATERIAL.replace("0.61803398874", "0")
    texts = {
        "hex_prism": HEX_PRISM,
        "blend_shader": BLEND_SHADER,
        "blend_material": BLEND_MATERIAL,
        "blend_material1": BLEND_MATERIAL,
        "blend_material2": other,
        "sphere": SPHERE,
        "three": THREE,
        "scene": SCENE,
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.json").write_text(text)
    return tmp_path


def write(folder: Path, data: Any, name: str = "x.json") -> Path:
    path = folder / name
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def model(folder: Path, node: Any, **tables: Any) -> Shape:
    made = load(write(folder, {"name": "x", **tables, "model": node}))
    assert isinstance(made, Shape)
    return made


def ball(*centre: float, radius: float = 0.5) -> Floats:
    return np.linalg.norm(POINTS - centre, axis=1) - radius


def test_algorithm_11_a_primitive(folder: Path) -> None:
    kind = load(folder / "hex_prism.json")
    assert isinstance(kind, SnippetKind)
    assert (kind.source.name, kind.source.id) == ("HexPrism", 33)
    shape = model(folder, {"type": "Primitives/HexPrism", "data": [0.5, 0.25]})
    assert shape == kind(0.5, 0.25)
    assert isinstance(shape, Snippet)
    assert shape.values == (0.5, 0.25, 0, 0, 0, 0, 0, 0)


def test_algorithms_16_and_17_a_shader_and_a_material(folder: Path) -> None:
    shader, material = load(folder / "blend_shader.json"), load(folder / "blend_material.json")
    assert isinstance(shader, FragmentShader)
    assert isinstance(material, ShadedMaterial)
    assert material.shader == shader
    values = {"_Color1": (0.5, 0.1, 0.5), "_Color2": (0.2, 0.7, 0.6), "_Blend": (0.61803398874,)}
    assert described(material) == values


def test_algorithm_19_a_model(folder: Path) -> None:
    shape = load(folder / "sphere.json")
    assert isinstance(shape, Transformed)
    scaled = np.linalg.norm((POINTS - (0.3, 0.2, 0)) / (1, 2, 4), axis=1) - 0.5
    np.testing.assert_allclose(shape(POINTS), scaled, atol=1e-12)
    assert isinstance(shape.shape, Painted)
    assert shape.shape.surface == load(folder / "blend_material.json")


def test_algorithm_20_an_operation_and_inherited_materials(folder: Path) -> None:
    shape = load(folder / "three.json")
    assert isinstance(shape, Painted)
    expected = np.min([ball(0.3, 0.2, 0), ball(0.1, 0.4, 0), ball(0.3, 0.1, 0)], axis=0)
    np.testing.assert_allclose(shape(POINTS), expected, atol=1e-12)
    first, second, third = shape.shape.children
    own = second.children[0]
    assert isinstance(own, Painted)
    assert own.surface == load(folder / "blend_material2.json") != shape.surface
    assert not any(isinstance(child.children[0], Painted) for child in (first, third))


def test_algorithm_22_a_scene(folder: Path) -> None:
    scene = load(folder / "scene.json")
    assert isinstance(scene, Scene)
    assert scene.name == "Cena1"
    (implicit,) = scene.implicits
    np.testing.assert_array_equal(np.array(implicit.transform)[:3, 3], (-0.8, 0, 0))
    esfera, three = load(folder / "sphere.json"), load(folder / "three.json")
    assert isinstance(esfera, Shape)
    assert isinstance(three, Shape)
    assert isinstance(implicit.shape, Shape)
    np.testing.assert_array_equal(implicit.shape(POINTS), np.minimum(three(POINTS), esfera(POINTS)))


def test_a_scene_is_put_on_a_stage(folder: Path) -> None:
    for name in ("scene.json", "three.json"):
        scene = tyndall.load(folder / name)
        assert len(scene.implicits) == len(scene.lights) == 1
        low, high = scene.implicits[0].bounds or (0, 0)
        centre = (np.array(low) + high) / 2
        assert np.linalg.norm(np.array(scene.camera.target) - centre) < 0.5
    own = {**parse(SCENE), "camera": {"position": [0, 0, 9]}, "lights": [{"kind": "directional", "intensity": 3}]}
    scene = tyndall.load(write(folder, own))
    assert scene.camera.position == (0, 0, 9)
    assert scene.lights == (DirectionalLight(intensity=3),)
    assert not scene.instances


def test_code_of_several_lines_is_drawn_too(folder: Path) -> None:
    """What :func:`tyndall.load` takes for a scene may have line ends in its texts; parts of one say what they are."""
    given = HEX_PRISM.rstrip().removesuffix("}") + "}"
    text = f'{{"model": {{"type": "Primitives/HexPrism"}}, "primitives": [{given}]}}'
    (implicit,) = tyndall.load(write(folder, text, "inline.json")).implicits
    assert implicit.shape == load(folder / "inline.json")
    for name, what in (
        ("hex_prism", "custom primitive"),
        ("blend_shader", "fragment shader"),
        ("blend_material", "mat"),
    ):
        with pytest.raises(SceneError, match=f"is a {what}.*; a model or a scene that uses it can be drawn"):
            tyndall.load(folder / f"{name}.json")
    with pytest.raises(SceneError, match="not JSON: .* at line 3 column 9"):
        tyndall.load(write(folder, '{"code": "\n", \n"model" 3}', "wrong.json"))


# --- transforms ---------------------------------------------------------------------------------------------------


def test_scale_then_rotation_then_translation(folder: Path) -> None:
    """Right-handed, R = Rz·Ry·Rx: about X first."""
    place = {
        "scale": {"x": 2, "y": 3, "z": 4},
        "rotation": {"x": 0.3, "y": 0.5, "z": 0.7},
        "position": {"x": 1, "y": 2, "z": 3},
    }
    shape = model(folder, {"type": "Primitives/Sphere", "transform": place})
    assert isinstance(shape, Transformed)
    turn = rotation(0.7, (0, 0, 1)) @ rotation(0.5, (0, 1, 0)) @ rotation(0.3, (1, 0, 0))
    expected = turn @ np.diag([2, 3, 4, 1.0])
    expected[:3, 3] = 1, 2, 3
    np.testing.assert_allclose(shape.placement, expected, atol=1e-15)
    quarter = model(folder, {"type": "Primitives/Sphere", "transform": {"rotation": {"z": math.pi / 2}}})
    assert isinstance(quarter, Transformed)
    np.testing.assert_allclose(quarter.placement @ (1, 0, 0, 1), (0, 1, 0, 1), atol=1e-15)


def test_a_quaternion_is_the_same_turn(folder: Path) -> None:
    axis, angle = np.array([1.0, 2.0, 2.0]) / 3, 0.8
    x, y, z = 5 * math.sin(angle / 2) * axis  # of any length
    turned = {"rotation": {"x": x, "y": y, "z": z, "w": 5 * math.cos(angle / 2)}}
    shape = model(folder, {"type": "Primitives/Cuboid", "transform": turned})
    assert isinstance(shape, Transformed)
    np.testing.assert_allclose(shape.placement, rotation(angle, axis), atol=1e-15)


def test_transforms_are_relative_to_the_parent(folder: Path) -> None:
    child = {"type": "Primitives/Sphere", "data": [0.5], "transform": {"position": {"x": 0.5}}}
    parent = {"type": "Operations/Union", "children": [child], "transform": {"scale": {"x": 2, "y": 2, "z": 2}}}
    np.testing.assert_allclose(model(folder, parent)(POINTS), ball(1, 0, 0, radius=1.0), atol=1e-12)


def test_a_primitive_with_children_is_a_union(folder: Path) -> None:
    child = {"type": "Primitives/Sphere", "data": [0.25], "transform": {"position": [0, 1, 0]}}
    shape = model(folder, {"type": "Primitives/Sphere", "data": [0.5], "children": [child]})
    np.testing.assert_allclose(shape(POINTS), np.minimum(ball(0, 0, 0), ball(0, 1, 0, radius=0.25)))


def test_an_operation_is_done_to_all_children(folder: Path) -> None:
    two = [{"type": "Primitives/Sphere", "data": [r]} for r in (0.25, 0.5)]
    shape = model(folder, {"type": "Operations/Round", "radius": 0.125, "children": two})
    np.testing.assert_allclose(shape(POINTS), ball(0, 0, 0, radius=0.625))


@pytest.mark.parametrize("name", OPERATIONS)
def test_operations_and_their_smooth_forms(folder: Path, name: str) -> None:
    two = [{"type": "Primitives/Sphere", "data": [r]} for r in (0.25, 0.5)]
    shape = model(folder, {"type": f"Operations/{name}", "factor": 0.25, "children": two})
    assert shape == Combination((sdf.sphere(0.25), sdf.sphere(0.5)), OPERATIONS[name], 0.25)


def test_the_rest_of_eight_numbers_is_ignored(folder: Path) -> None:
    assert model(folder, {"type": "Primitives/Sphere", "data": [0.5, 1, 2, 3, 4, 5, 6, 7]}) == sdf.sphere(0.5)
    assert model(folder, {"type": "Primitives/Sphere", "radius": 0.5}) == sdf.sphere(0.5)
    assert model(folder, {"type": "Primitives/Sphere"}) == sdf.sphere()
    star = model(folder, {"type": "Operations/Extrude", "children": [{"type": "Primitives/Star", "data": [7, 1, 0.5]}]})
    assert star.children[0] == sdf.star(7, 1, 0.5)


# --- round trips --------------------------------------------------------------------------------------------------


def round_trip(folder: Path, shape: Shape) -> None:
    path = folder / "shape.json"
    save(shape, path)
    again = load(path)
    assert again == shape
    assert repr(again) == repr(shape)  # −0.0 is not 0.0
    first = path.read_bytes()
    save(again, path)  # type: ignore[arg-type]
    assert path.read_bytes() == first


def some_value(f: Field, random: np.random.Generator) -> Any:
    def number(tp: Any) -> Any:
        low = -2.0 if f.param.low is None else f.param.low
        high = max(low + 2.0, 1.0) if f.param.high is None else f.param.high
        return bool(random.integers(2)) if tp is bool else tp(random.uniform(low, min(high, low + 4)))

    args = get_args(f.type)
    if get_origin(f.type) is tuple:
        return tuple(number(a) for a in args)
    return args[random.integers(len(args))] if args else number(f.type)


def instances(cls: type[Shape]) -> list[Shape]:
    """A class with its defaults, and with some other values where it takes them."""
    random, found = np.random.default_rng(3), []
    for attempt in range(12):
        values = {f.name: some_value(f, random) for f in fields_of(cls)} if attempt else {}
        flat = {"shape": child} if (child := CHILDREN.get(cls.__name__)) else {}
        for inner in (flat or {"shape": sdf.sphere(0.25)}, {"shape": FLAT} if FLAT else {}):
            try:
                found.append(cls(**({} if issubclass(cls, Primitive) else inner), **values))
                break
            except (ParameterError, TypeError):
                continue
    return found[:4]


CHILDREN: dict[str, Shape] = {}
FLAT: Shape | None = next(
    (cls() for cls in node_classes().values() if issubclass(cls, Primitive) and getattr(cls, "dimension", 3) == 2), None
)


@pytest.mark.parametrize("name", [name for name, cls in node_classes().items() if not hasattr(cls, "from_data")])
def test_every_kind_of_node_comes_back(tmp_path: Path, name: str) -> None:
    made = instances(node_classes()[name])
    assert made, f"{name}: nothing could be made"
    for shape in made:
        round_trip(tmp_path, shape)


def test_samples_of_a_mesh_come_back(tmp_path: Path) -> None:
    x = np.linspace(-1, 1, 5, dtype=np.float32)
    samples = np.linalg.norm(np.stack(np.meshgrid(x, x, x), axis=-1), axis=-1) - 0.7
    round_trip(tmp_path, Grid(samples, (-1, -1, -1), 0.5).at(1))
    wrong = (tmp_path / "shape.json").read_text().replace('"counts": [5', '"counts": [6')
    (tmp_path / "shape.json").write_text(wrong)
    assert mistakes(tmp_path / "shape.json")[0].startswith("model: ")


RED = Material("red", (1, 0, 0.1, 1), metallic=1.0, roughness=0.1 + 0.2, emissive=(0.0, 1e-30, 1 / 3))
GLOW = FragmentShader(
    "Glow", "fn shade(p: FragmentProperties) -> vec3f { return _c * f32(_n.y); }", ("[float3] _c", "[int2] _n")
)  # type: ignore[arg-type]
GLOW2 = FragmentShader("Glow", "fn shade(p: FragmentProperties) -> vec3f { return vec3f(p.ray_distance); }")
WAVE = SnippetSource("wave", 'fn wave(p: vec3f, k: f32, q: vec2f) -> f32 { return k * sin(p.x) + q.y; }\n// "é\\ 𝄞', 40)
WAVE2 = SnippetSource("wave", "fn wave(p: vec3f) -> f32 { return sin(p.x); }")
NAMED_SPHERE = SnippetSource("Sphere", "fn sphere(p: vec3f) -> f32 { return length(p) - 1.0; }", 40)


@pytest.mark.parametrize(
    "shape",
    [
        sdf.sphere(0.1 + 0.2).at(-0.0, 1e-30, 1 / 3),
        sdf.sphere(1).scale(2).at(1, 2, 3),
        sdf.sphere(1).at(0, 0, 0),
        sdf.sphere(1).scale((1, -2, 3)),
        sdf.sphere(1).rotate(0.3, (1, 2, 3)).at(5),
        Transformed(Transformed(sdf.sphere(1), sdf.sphere(1).at(1).matrix), sdf.sphere(1).at(2).matrix),  # type: ignore[attr-defined]
        sdf.sphere(1).material(RED).at(1).named("é\n").material(RED),
        Painted(Painted(sdf.sphere(1), RED), Material()),
        Named(Named(sdf.sphere(1), "a"), " "),
        Combination((sdf.sphere(1),)),
        Combination((sdf.sphere(1).material(RED), sdf.box(2)), "subtraction", 0.25, "root"),
        Combination((sdf.sphere(1), Combination((sdf.box(1), sdf.box(2)))), "union"),
        Snippet(WAVE, (0.1, -0.0, 1e-20), 2.5, (-1, -math.inf, 0), (1, math.inf, 0.5), 0.5, True),
        Snippet(WAVE, (1, 2, 3)) | Snippet(WAVE2) | Snippet(NAMED_SPHERE) | sdf.sphere(2),
        sdf.sphere(1).material(GLOW.material(_c=(0.1, 1 / 3, -0.0), _n=(-3, 4), lit=False, material=RED)),
        sdf.sphere(1).material(GLOW.material(_c=(0, 0, 1), _n=(1, 2))) | sdf.box(1).material(GLOW2.material()),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_what_is_around_nodes_comes_back(tmp_path: Path, shape: Shape) -> None:
    round_trip(tmp_path, shape)


def test_a_shared_material_is_written_once_and_shared_again(tmp_path: Path) -> None:
    save(sdf.sphere(1).material(RED) | sdf.box(1).material(RED), tmp_path / "a.json")
    a, b = load(tmp_path / "a.json").children  # type: ignore[union-attr]
    assert a.surface is b.surface  # type: ignore[attr-defined]
    assert len(json.loads((tmp_path / "a.json").read_text())["materials"]) == 1


def test_a_scene_file_holds_implicit_surfaces(tmp_path: Path) -> None:
    matrix = np.diag([1, 2, 3, 1.0])
    glow = GLOW.material(_c=(0, 0, 1), _n=(1, 2))
    implicits = (
        Implicit(sdf.sphere(1).material(RED) | Snippet(WAVE, (1, 2, 3)), matrix, glow, "one"),  # type: ignore[arg-type]
        Implicit(sdf.sphere(1), material=RED),
    )
    scene = Scene(implicits=implicits, name="both", lights=(DirectionalLight(),))
    tyndall.save(scene, tmp_path / "scene.json")
    again = tyndall.load(tmp_path / "scene.json")
    assert again.lights == scene.lights
    assert not again.instances
    fields = ("shape", "transform", "material", "name")
    for a, b in zip(again.implicits, implicits, strict=True):
        assert all(getattr(a, name) == getattr(b, name) for name in fields)
    assert "implicits" not in json.loads(write_plain(tmp_path).read_text())


def test_a_scene_file_holds_volumes(tmp_path: Path) -> None:
    matrix = np.diag([1, 2, 3, 1.0])
    volumes = (
        Volume(sdf.sphere(1) | sdf.box(1), Medium(0.5, (0.1, 0.2, 0.3)), matrix, 0.25, "cloud"),  # type: ignore[arg-type]
        Volume(sdf.sphere(2), Medium(1.0)),
    )
    tyndall.save(Scene(volumes=volumes), tmp_path / "scene.json")
    again = tyndall.load(tmp_path / "scene.json").volumes
    for a, b in zip(again, volumes, strict=True):
        assert all(getattr(a, name) == getattr(b, name) for name in ("shape", "medium", "transform", "edge", "name"))
    document = json.loads((tmp_path / "scene.json").read_text())
    document["volumes"]["edges"] = [0.5]
    (tmp_path / "scene.json").write_text(json.dumps(document))
    with pytest.raises(SceneError, match="volumes: 2 surfaces, 2 media and 1 edges"):
        tyndall.load(tmp_path / "scene.json")


def write_plain(folder: Path) -> Path:
    tyndall.save(Scene(), folder / "plain.json")
    return folder / "plain.json"


def test_mistakes_of_a_scene_file_have_their_path(tmp_path: Path) -> None:
    tyndall.save(Scene(implicits=(Implicit(sdf.sphere(1) | Snippet(WAVE2)),)), tmp_path / "scene.json")
    text = (tmp_path / "scene.json").read_text()
    wrong = text.replace('"data": [1.0]', '"data": [-1.0]').replace("sin(p.x)", "sine(p.x)").replace('"fov"', '"fovv"')
    (tmp_path / "scene.json").write_text(wrong)
    with pytest.raises(SceneError) as error:
        tyndall.load(tmp_path / "scene.json")
    told = "\n".join(error.value.mistakes)
    assert "implicits.objects[0].shape.children[0].radius: -1 is outside" in told
    line = next(i for i, row in enumerate(wrong.splitlines(), 1) if "sine" in row)
    column = wrong.splitlines()[line - 1].index("sine") + 1
    assert f"implicits.primitives[0].code: scene.json:{line}:{column}: no such name: 'sine'" in told
    assert "camera.fovv: no such field" in told


# --- mistakes -----------------------------------------------------------------------------------------------------


def mistakes(path: Path) -> tuple[str, ...]:
    with pytest.raises(SceneError) as error:
        load(path)
    assert all("\n" not in mistake for mistake in error.value.mistakes)
    return error.value.mistakes


def test_all_mistakes_at_once(folder: Path) -> None:
    children: list[Any] = [
        {"type": "Primitives/Sphere", "data": [-1]},
        {"type": "Primitives/Spere"},
        {"type": "Operations/Round", "radius": "1", "children": []},
        {"type": "Primitives/Sphere", "colour": 1, "material_id": 3},
        {"type": "Primitives/Sphere", "transform": {"position": {"w": 1}, "scale": {"x": 0}}},
        {"type": "Operations/Union", "factor": -1, "blend": "cubic", "children": [3]},
        {"type": "Models/Esfere"},
        {"type": "Primitives/Cuboid", "data": [1, 2]},
        {"type": "Primitives/HexPrism", "data": [1, True]},
        {"type": "Widgets/Sphere"},
        {},
        {"type": "Primitives/Sphere", "transform": {"matrix": [[1, 0, 0, 0]]}},
        {"type": "Operations/SmoothUnion", "children": [{"type": "Primitives/Sphere"}]},
        {"type": "Primitives/Sphere", "transform": {"scale": {"x": 0}}},
    ]
    path = write(folder, {"name": "x", "model": {"type": "Operations/Union", "children": children}})
    expected = [
        "model.children[0].radius: -1 is outside ≥ 1e-06",
        "model.children[1].type: no such primitive: 'Spere' — did you mean 'Sphere'?",
        "model.children[2].radius: '1' is not a number",
        "model.children[2].children: 'Operations/Round' has none",
        "model.children[3].colour: no such field",
        "model.children[3].material_id: 3 is beyond the last of 0 materials",
        "model.children[4].transform.position.w: no such field",
        "model.children[5].children[0]: is not an object",
        "model.children[5].factor: -1 is outside ≥ 0",
        "model.children[5].blend: 'cubic' is not one of",
        "model.children[6].type: there is no model 'Esfere' in this file or its folder — did you mean 'Esfera'?",
        "model.children[7].data: 2 numbers; size needs 3",
        "model.children[8].data[1]: True is not a number",
        "model.children[9].type: 'Widgets/Sphere' is no kind of node",
        "model.children[10].type: is missing",
        "model.children[11].transform.matrix: is not four rows of four numbers",
        "model.children[12].factor: is missing",
        "model.children[13].transform: matrix: not finite numbers that have an inverse",
    ]
    told = mistakes(path)
    for mistake in expected:
        assert any(line.startswith(mistake) for line in told), (mistake, told)
    assert len(told) == len(expected), told


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{", "not JSON"),
        ('{"name": "a", "name": "b"}', "'name' is twice"),
        ('{"model": {"type": "Primitives/Sphere", "data": [NaN]}}', "NaN is not a finite number"),
        ('{"model": ' + '{"children": [' * 3000 + "]}" * 3000 + "}", "nested too deeply"),
        ("[1]", "is no primitive, shader, material, model or scene"),
        ('{"a": 1}', "is no primitive"),
        ('{"name": "x", "code": "fn f() {}", "id": 31}', "id: 31 is not a whole number ≥ 32"),
        ('{"name": "x", "code": "fn f() {}", "id": 33}', "code: x.json:1:24: 'f' is the shape"),
        ('{"name": "x", "code": 1, "id": 33}', "code: is not a text"),
        ('{"base_shader": "Banana"}', "base_shader: there is no shader 'Banana'"),
        ('{"base_shader": 0}', "base_shader: 0 is beyond the last of 0 shaders"),
        ('{"base_color": [1, 2, 0, 1]}', "base_color: 2 is outside 0 … 1"),
        ('{"scene": {}}', "scene: is not a list"),
        ('{"scene": [], "lights": [{"kind": "spot", "intensity": -1}]}', "lights[0].intensity: -1 is outside ≥ 0"),
        ('{"scene": [], "medium": {"scatering": 1}}', "medium.scatering: no such field"),
        ('{"properties": ["[colour] a"], "code": "x"}', "properties[0]: a: 'colour' is not float or int"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, data: str, message: str) -> None:
    assert any(message in mistake for mistake in mistakes(write(tmp_path, data)))


def test_materials_that_are_wrong(folder: Path) -> None:
    wrong = BLEND_MATERIAL.replace("0.61803398874", "1.5").replace(
        '"_Color2", "type": "float3"', '"_Color2", "type": "int"'
    )
    told = mistakes(write(folder, wrong.replace("(0.5,0.1,0.5)", "(0.5,0.1)").replace("_Color2", "_Colour2")))
    assert [m.partition(": ")[0] for m in told] == [
        "properties[0].value",
        "properties[1].name",
        "properties[2].value",
        "properties",
    ]
    assert "1.5 is outside 0 … 1" in told[2]
    assert "did you mean '_Color2'?" in told[1]


def test_slang_as_in_the_document_is_told(folder: Path) -> None:
    """Algorithms 11 and 16 as they are printed."""
    slang = '{"name": "HexPrism",\n"id": 34,\n"code":\n"float sdHexPrism(vec3 p, Primitive3D primitive) {\n}"\n}'
    (told,) = mistakes(write(folder, slang))
    assert told.startswith("code: x.json:4:2: this looks like ")
    assert "WGSL" in told
    shader = json.dumps({"name": "B", "properties": ["[float3] _Color1"], "code": "\nfloat3 _Color1;\nfloat3 shade()"})
    (told,) = mistakes(write(folder, shader))
    column = shader.index("float3 _Color1;") + 1
    assert told.startswith(f"code: x.json:1:{column}: this looks like Slang or HLSL ('float3')")


def test_a_mistake_in_another_file_names_it(folder: Path) -> None:
    write(folder, SPHERE.replace("[0.5]", "[-1]"), "sphere.json")
    told = mistakes(folder / "scene.json")
    assert told == ("scene[0].children[1].model: sphere.json: model.radius: -1 is outside ≥ 1e-06",)


def test_a_model_that_contains_itself(folder: Path) -> None:
    for name, inner in (("A", "B"), ("B", "A")):
        node = {"type": "Operations/Union", "children": [{"type": f"Models/{inner}"}]}
        write(folder, {"name": name, "model": node}, f"{name}.json")
    assert any("contains itself" in mistake for mistake in mistakes(folder / "A.json"))


def test_a_model_that_grows_tenfold(tmp_path: Path) -> None:
    write(tmp_path, {"name": "m0", "model": {"type": "Primitives/Sphere"}}, "m0.json")
    for i in range(1, 9):
        ten = [{"type": f"Models/m{i - 1}"}] * 10
        write(tmp_path, {"name": f"m{i}", "model": {"type": "Operations/Union", "children": ten}}, f"m{i}.json")
    assert any("a shape has at most" in mistake for mistake in mistakes(tmp_path / "m8.json"))


def test_references_stay_in_the_folder(folder: Path) -> None:
    inner = folder / "inner"
    inner.mkdir()
    told = mistakes(write(inner, {"model": {"type": "Models/../sphere"}}))
    assert "there is no model '../sphere'" in told[0]


def test_what_cannot_be_saved(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="saved as .json"):
        save(sdf.sphere(1), tmp_path / "a.txt")
    with pytest.raises(ParameterError, match="^shape: int is no shape$"):
        save(3, tmp_path / "a.json")  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="not text that UTF-8"):
        save(sdf.sphere(1).named("\ud800"), tmp_path / "a.json")
    assert not list(tmp_path.iterdir())


def test_names_are_those_of_the_classes() -> None:
    """Generated from the declarations: no list to forget a new node in."""
    names = node_classes()
    assert names["Primitives/Sphere"] is type(sdf.sphere())
    assert all(name.startswith(("Primitives/", "Profiles/", "Operations/")) for name in names)
    assert GROUP not in names


def test_places_of_texts() -> None:
    text = '{"a": ["x", {"b\\n": "y", "c": [1, "z"]}], "d": "w", "e": {}}'
    found = {path: text[at] for path, at in places(text).items()}
    assert found == {("a", 0): "x", ("a", 1, "b\n"): "y", ("a", 1, "c", 1): "z", ("d",): "w"}


def test_whatever_a_file_holds_it_is_told_in_lines(folder: Path) -> None:
    """Files with a value exchanged for another, or left out: loaded, or refused with a path."""
    random = np.random.default_rng(2)
    odd: list[Any] = [None, True, -1, 0, 1e30, 1e400, "x", "", [], {}, [1, 2, 3], {"x": 1}, [[]], "Primitives/Sphere"]
    sources = [SPHERE, THREE, SCENE, BLEND_MATERIAL, BLEND_SHADER, HEX_PRISM]

    def mutate(value: Any) -> Any:
        if random.random() < 0.08:
            return odd[random.integers(len(odd))]
        if isinstance(value, dict):
            return {k: mutate(v) for k, v in value.items() if random.random() > 0.04}
        return [mutate(v) for v in value] if isinstance(value, list) else value

    loaded, told = 0, []
    for i in range(150):
        path = write(folder, mutate(parse(sources[i % len(sources)])))
        try:
            load(path)
            loaded += 1
        except SceneError as error:
            told += error.mistakes
    assert all(mistake and "\n" not in mistake for mistake in told)
    assert 10 < loaded < 140


# --- the docs -----------------------------------------------------------------------------------------------------

DOCS = Path(__file__).parents[4] / "docs" / "sdf-json.md"


def docs() -> str:
    if not DOCS.exists():
        pytest.skip("an installed package has no docs folder")
    return DOCS.read_text()


def row(name: str, cls: type[Shape]) -> str:
    """The line of a type in the docs' table."""
    if hasattr(cls, "from_data"):
        return f"| `{name}` | as it was saved |"
    parts = []
    for f in fields_of(cls):
        args = get_args(f.type)
        is_vector = get_origin(f.type) is tuple
        parts.append(f"`{f.name}`" + (f" × {len(args)}" if is_vector else f" ({', '.join(args)})" if args else ""))
    return f"| `{name}` | {', '.join(parts) or 'none'} |"


def test_the_docs_have_every_type() -> None:
    lines = docs().splitlines()
    rows = [row(name, cls) for name, cls in node_classes().items()]
    missing = [text for text in rows if text not in lines]
    assert not missing, "docs/sdf-json.md lacks:\n" + "\n".join(missing)


def test_the_examples_of_the_docs_are_right(tmp_path: Path) -> None:
    blocks = re.findall(r"```json\n(.*?)```", docs(), re.DOTALL)
    paths = [write(tmp_path, block, f"{i}.json") for i, block in enumerate(blocks)]
    made = [load(path) for path in paths]
    assert [type(thing) for thing in made] == [SnippetKind, FragmentShader, ShadedMaterial, Painted, Scene]


def test_a_scene_that_could_not_be_read_again_is_not_written(tmp_path: Path) -> None:
    """Scene files may be nested less deeply than models' own."""
    shape = sdf.sphere(1)
    while shape.depth < 200:
        shape = shape.round(1e-3)
    with pytest.raises((ParameterError, SceneError), match="nested too deeply for a scene file"):
        tyndall.save(Scene(implicits=(Implicit(shape),)), tmp_path / "scene.json")
    sdf.save(shape, tmp_path / "model.json")
    assert sdf.load(tmp_path / "model.json") == shape
