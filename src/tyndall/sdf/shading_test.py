"""A shader gets what it is told of the place, its material's numbers, and nothing else."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Mat4, Material, Scene
from tyndall.sdf import sphere
from tyndall.sdf.sandbox import SnippetError
from tyndall.sdf.shading import FragmentShader, Property, Shadings, described, validate
from tyndall.techniques.antialiasing import NoAntialiasing
from tyndall.techniques.volumetric import Off

RED = Material("red", (1, 0, 0, 1))

# Algorithms 16 and 17 of the document, in WGSL.
BLEND = FragmentShader(
    "Blend Shader",
    "fn shade(properties: FragmentProperties) -> vec3f { return mix(_Color1, _Color2, _Blend); }",
    ("[float3] _Color1", "[float3] _Color2", "[float] [Range(0, 1)] _Blend"),  # type: ignore[arg-type]
)
PURPLE = {"_Color1": (0.5, 0.1, 0.5), "_Color2": (0.2, 0.7, 0.6), "_Blend": 0.61803398874}
TELL = FragmentShader(
    "Tell",
    """fn shade(p: FragmentProperties) -> vec3f {
        if which == 0 { return p.world_position; }
        if which == 1 { return p.object_position; }
        if which == 2 { return p.world_normal; }
        if which == 3 { return p.ray_direction; }
        if which == 4 { return vec3f(p.ray_distance); }
        loop { }
        return vec3f(1.0);
    }""",
    (Property("which", "int", 0, 9),),
)


def at(x: float) -> Mat4:
    """Two metres before the camera."""
    return ((1, 0, 0, x), (0, 1, 0, 0), (0, 0, 1, -2), (0, 0, 0, 1))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[float] [Range(0, 1)] _Blend", Property("_Blend", "float", 0, 1)),
        ("[float3]_Color1", Property("_Color1", "float3")),
        (" [ int2 ] [ Range( -1.5 , 2e3 ) ] a ", Property("a", "int2", -1.5, 2000)),
    ],
)
def test_annotations(text: str, expected: Property) -> None:
    assert Property.parse(text) == expected
    assert Property.parse(expected.text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("_Blend", "is not like"),
        ("[texture] a", "'texture' is not float or int"),
        ("[float5] a", "'float5' is not float or int"),
        ("[float] [Range(1, 0)] a", "is empty"),
        ("[float] [Range(a, b)] a", "not two numbers"),
        ("[float] length", "'length' cannot be the name"),
        ("[float] [Min(1)] a", "is not like"),
    ],
)
def test_annotations_that_are_none(text: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Property.parse(text)


def test_a_material_is_an_instance() -> None:
    material = BLEND.material(**PURPLE, material=Material("purple", roughness=0.25))
    assert isinstance(material, Material)
    assert (material.name, material.roughness, material.lit) == ("purple", 0.25, True)
    assert described(material)["_Color2"] == (0.2, 0.7, 0.6)
    assert material == BLEND.material(**PURPLE, material=Material("purple", roughness=0.25))
    assert hash(material) != hash(BLEND.material(**PURPLE))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"_Blend": 1.5}, "_Blend: 1.5 is outside 0 … 1"),
        ({"_Blend": (1, 2)}, "is not float"),
        ({"_Color1": 0.5}, "is not float3"),
        ({"_Colour1": 0.5}, "no such property of 'Blend Shader' — did you mean '_Color1'?"),
        ({"_Blend": float("nan")}, "is not finite"),
        ({"_Blend": "1"}, "is not float"),
    ],
)
def test_values_that_are_none(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message.replace("?", r"\?")):
        BLEND.material(**{**PURPLE, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fn other() {}", "1:1: there is no function"),
        ("fn shade(p: vec3f) -> vec3f { return p; }", "1:1: 'shade' is fn shade"),
        ("const _Blend = 1.0; fn shade(p: FragmentProperties) -> vec3f { return p.ray_direction; }", "already"),
        ("float3 shade(FragmentProperties properties) { return lerp(_Color1, _Color2, _Blend); }", "Slang"),
    ],
)
def test_texts_that_are_refused(text: str, message: str) -> None:
    with pytest.raises(SnippetError, match=message):
        FragmentShader("x", text, BLEND.properties)


def test_types_are_checked_by_the_driver(gpu: Gpu) -> None:
    validate(gpu, BLEND)
    wrong = FragmentShader("x", "fn shade(p: FragmentProperties) -> vec3f {\n  return p.ray_distance;\n}")
    with pytest.raises(SnippetError, match=r"<shader>:2:\d+: "):
        validate(gpu, wrong)


def test_on_the_device(gpu: Gpu) -> None:
    """Each member, the numbers of two materials of one shader, and a loop without end."""
    shadings = Shadings()
    assert shadings.of(Material()) == (-1, 0)
    assert shadings.is_trusted
    materials = [BLEND.material(**PURPLE), BLEND.material(**{**PURPLE, "_Blend": 0.0})]
    materials += [TELL.material(which=i) for i in range(6)]
    calls = [shadings.of(m) for m in materials]
    assert shadings.version == len(shadings.shaders) == 2
    shadings.validate(gpu)
    numbers = ", ".join(f"{x!r}" for x in shadings.numbers.tolist())
    text = shadings.wesl() + (
        f"\nconst NUMBERS = array<f32, {len(shadings.numbers)}>({numbers});\n"
        "fn implicit_number(i: u32) -> f32 { var n = NUMBERS; return n[i]; }"
    )
    body = "\n".join(
        f"out[{i}] = vec4f(implicit_shade({s}u, {at}u, vec3f(1.0), vec3f(2.0), vec3f(3.0), vec3f(4.0), 5.0), 1.0);"
        for i, (s, at) in enumerate(calls)
    )
    module = (
        f"import package::bindings::{{out, implicit_shade}};\n@compute @workgroup_size(1)\nfn main() {{\n{body}\n}}\n"
    )
    with (
        props.module(gpu, "test_shading", module) as path,
        gpu.buffer("test.out", 16 * len(calls), owner="test", element="vec4f") as out,
    ):
        gpu.compute("test", path, "main").bind(out=out.read_write().telling(text, untrusted=True)).dispatch(1)
        got = gpu.read_buffer(out).view(np.float32).reshape(-1, 4)[: len(calls), :3]
        gpu.forget_groups()
    t = 0.61803398874
    purple = (1 - t) * np.array(PURPLE["_Color1"]) + t * np.array(PURPLE["_Color2"])
    np.testing.assert_allclose(got[:2], [purple, PURPLE["_Color1"]], rtol=1e-6)
    np.testing.assert_array_equal(got[2:7], np.repeat([[1], [2], [3], [4], [5]], 3, axis=1))
    np.testing.assert_array_equal(got[7], 0)


def test_without_shaders_there_is_still_a_function() -> None:
    assert "implicit_shade" in Shadings().wesl()
    assert Shadings().numbers.shape == (1,)


def test_in_a_picture(gpu: Gpu) -> None:
    """Lit, the colour is the albedo; else it is emitted, from the place, normal and ray of each pixel."""
    told = FragmentShader(
        "Told",
        """fn shade(p: FragmentProperties) -> vec3f {
            if which == 0 { return p.world_normal * 0.5 + 0.5; }
            return vec3f(p.ray_distance, dot(p.object_position, p.object_position), -p.ray_direction.z);
        }""",
        (Property("which", "int"),),
    )
    spheres = [
        Implicit(sphere(0.4).material(BLEND.material(**PURPLE)), at(-0.6)),
        Implicit(sphere(0.4) | sphere(0.1).material(RED).at(9), at(0.6), told.material(which=0, lit=False)),
        Implicit(sphere(0.2), at(0.0), told.material(which=1, lit=False)),
    ]
    scene = Scene(camera=props.AHEAD, implicits=tuple(spheres))
    with Renderer(scene, (48, 36), gpu=gpu, volumetric=Off(), antialiasing=NoAntialiasing()) as renderer:
        renderer.draw()
        images = {name: gpu.read_texture(renderer._images[name]) for name in ("albedo_metallic", "emissive")}
        normals = renderer.surface("normals")
    t = 0.61803398874
    purple = (1 - t) * np.array(PURPLE["_Color1"]) + t * np.array(PURPLE["_Color2"])
    np.testing.assert_allclose((images["albedo_metallic"][18, 13, :3] / 255) ** 2, purple, atol=0.01)
    assert not images["emissive"][18, 13, :3].any()
    seen = np.linalg.norm(normals, axis=2) > 0.5
    seen[:, :30] = False
    assert seen.sum() > 20
    np.testing.assert_allclose(images["emissive"][seen][:, :3], normals[seen] * 0.5 + 0.5, atol=0.005)
    assert not images["albedo_metallic"][seen][:, :3].any()
    distance, square, ahead = images["emissive"][18, 24, :3].astype(float)
    np.testing.assert_allclose([distance, square, ahead], [1.8, 0.04, 1.0], atol=0.01)
