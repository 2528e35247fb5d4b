"""Every shader of the package compiles, in every combination that the techniques make, and is used by one of them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import props
import pytest

import tyndall.sdf
from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import fields_of
from tyndall.lab.baseline import Baseline
from tyndall.lab.busy import Busy
from tyndall.lab.field_check import values
from tyndall.lab.truth import TruthSettings, trace
from tyndall.scene.model import (
    DirectionalLight,
    Image,
    Implicit,
    Instance,
    Material,
    Medium,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
    Texture,
    Volume,
)
from tyndall.sdf import sphere, union
from tyndall.sdf.field import Field
from tyndall.sdf.snippets import Snippet, SnippetSource, evaluate
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow.depth_maps import IN_WORDS
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.tracing.cast import blocked, cast
from tyndall.tracing.world import World

_ENTRY = re.compile(r"@(?:compute|vertex|fragment)\b(?:\s*@\w+(?:\([^)]*\))?)*\s*fn\s+(\w+)")
SMALL = {"froxel": {"grid": (8, 6, 4)}, "march": {"steps": 4}, "shadow_map": {"size": 64}}

_pixels = np.full((4, 4, 4), 255, np.uint8)
_pixels[::2, ::2, 3] = 0
_leaf = Material("leaf", (1, 1, 1, 1), alpha_mode="mask", base_color_texture=Texture(Image(_pixels)))
_mirror = ((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
SHAPES = [props.floor(-1, 5), Instance(props.box((-1, -1, -4), (0, 0, -3)).mesh, _mirror), props.wall(-5, 2, _leaf)]
LIGHTS = [
    DirectionalLight((0.2, -1, 0.4)),
    PointLight((0, 1, -2), radius=0.1),
    SpotLight((1, 2, -2), (-0.2, -1, -0.2)),
    RectLight((-1, 2, -2), (0.2, -1, -0.2), width=0.5),
]


def entry_points(gpu: Gpu) -> set[tuple[str, str]]:
    """(module, entry point) of the package's WESL files."""
    return {
        (module, name)
        for module, text in gpu.linker.modules.items()
        if not module.startswith("package::test_")
        for name in _ENTRY.findall(text)
    }


def variants(family: str) -> list[tuple[str, dict[str, object]]]:
    """Each technique with its defaults, and once for each value of each text parameter."""
    found = []
    for name, cls in FAMILIES[family].members.items():
        sides = {f.name: 64 for f in fields_of(cls) if family == "shadow" and f.name in ("size", "map_size")}
        base: dict[str, object] = {**sides, **SMALL.get(name, {})}
        found.append((name, base))
        for f in fields_of(cls):
            choices = getattr(f.type, "__args__", ()) if isinstance(f.default, str) else ()
            found += [(name, {**base, f.name: choice}) for choice in choices if choice != f.default]
    return found


def test_every_entry_point_compiles_and_is_used(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    """Draws with each technique, all kinds of light and of material, and traces; then nothing may be left over."""
    drawn = 0
    for lights in (LIGHTS, LIGHTS[:1]):
        scene = Scene(SHAPES, lights, props.AHEAD, Medium(0.1, 0.02))
        start = {
            family: FAMILIES[family].make(None, changes=SMALL.get(FAMILIES[family].default)) for family in FAMILIES
        }
        with Renderer(scene, (8, 6), gpu=gpu, **start) as renderer:
            for family in FAMILIES:
                for name, changes in variants(family):
                    try:
                        renderer.use(family, FAMILIES[family].make(name, changes=changes))
                    except Unsupported:
                        continue
                    renderer.draw()
                    assert np.isfinite(renderer.radiance()).all(), (family, name, changes)
                    drawn += 1
                renderer.use(family, start[family])
            assert (renderer.depth() > 0).all()
    assert drawn >= 2 * 10
    solid = Scene(SHAPES[:2], LIGHTS[:1], props.AHEAD)  # maps of what has holes are not drawn in compute
    with Renderer(solid, (8, 6), gpu=gpu, shadow=ShadowMap(size=64, rasterizer="compute")) as renderer:
        renderer.draw()
    for limit in ("_LONG", "_SPLIT"):  # so that a short program's leaves are sorted out, and its cells split, as well
        monkeypatch.setattr(f"tyndall.sdf.field.{limit}", 8)
    short, long = (union(*[sphere(0.1).at(0.2 * i) for i in range(n)], smooth=0.1) for n in (6, 9))
    short = (short | sphere(0.1).at(0, 0.3).named("part")) - sphere(0.05)  # no union
    surface = Material(emissive=(1, 1, 1), reflections=True)
    surfaces = [Implicit(shape, _mirror, surface) for shape in (short, long)]
    cloud = Volume(sphere(0.5), Medium(0.1))
    fields = Scene(SHAPES[:1], LIGHTS[:1], props.AHEAD, Medium(0.1), implicits=surfaces, volumes=[cloud])
    with Renderer(fields, (8, 6), gpu=gpu, shadow=ShadowMap(size=16)) as renderer:
        for _ in range(3):  # with reflections and clouds, compiled for each kind of shadow, and in motion
            renderer.draw()
            renderer.move("part", np.eye(4))
        for family in ("reflection", "volume"):
            renderer.use(family, "none")
        renderer.use("occlusion", "field_ao")
        for name in ("field", "planar", "projective"):
            cls = FAMILIES["shadow"].members[name]
            small = {f.name: 16 for f in fields_of(cls) if f.name in ("size", "map_size")}
            renderer.use("shadow", FAMILIES["shadow"].make(name, changes=small))
            renderer.draw()
    for depth in (2, 3):
        trace(scene, (8, 6), TruthSettings(target=1, depth=depth), gpu=gpu, cache=False)
    with World(gpu, scene, movable=True) as world:
        world.move({0: _mirror})
        cast(gpu, world, [[0, 0, 0]], [[0, 0, -1]])
        blocked(gpu, world, [[0, 0, 0]], [[0, 0, -1]])
    evaluate(gpu, Snippet(SnippetSource("plane", "fn plane(p: vec3f) -> f32 { return p.y; }")), np.zeros((1, 3)))
    monkeypatch.setattr("tyndall.sdf.field._MANY", 1)  # so that one leaf's place is sent as those of many are
    with Field(gpu, [Implicit(sphere().named("ball"))]) as field:
        field.move("ball", np.zeros((1, 3)))
        values(gpu, field, 0, [[0, 0, 0]])
    for stage in ("fragment", "compute"):
        with Baseline(gpu, Scene(implicits=(Implicit(sphere()),)), (8, 6), stage=stage):  # type: ignore[arg-type]
            pass
    monkeypatch.setattr("tyndall.lab.busy._ROUNDS", 2)
    monkeypatch.setitem(gpu.adapter_info, "adapter_type", "DiscreteGPU")
    with Busy(gpu) as busy:
        busy()
    monkeypatch.setattr("tyndall.tracing.world.STACK", 0)
    with pytest.raises(GpuError, match="-2 can be followed"):
        World(gpu, scene)
    compiled = {(key[0], entry) for key in gpu._programs for entry in key[1]}
    left = entry_points(gpu) - compiled
    assert not left, f"never compiled by a technique, the truth or rays: {sorted(left)}"


def test_entry_points_are_found(gpu: Gpu) -> None:
    """The search above sees what there is: every stage, attributes in any order."""
    found = entry_points(gpu)
    assert {
        ("package::frame", "lighting"),
        ("package::content::mesh", "vertex"),
        ("package::content::mesh", "fragment"),
        ("package::techniques::volumetric::froxel", "accumulate"),
    } <= found
    text = "@compute\nfn a() {}\n@compute @workgroup_size(8, 8)\nfn b() {}\nfn c() {}\n@vertex fn d() {}"
    assert _ENTRY.findall(text) == ["a", "b", "d"]


def test_every_module_is_imported_or_has_an_entry_point(gpu: Gpu) -> None:
    """No shader file lies about unused."""
    texts = {m: t for m, t in gpu.linker.modules.items() if not m.startswith("package::test_")}
    roots = {module for module, _ in entry_points(gpu)}
    overlaid = {cls.shader() for family in ("shadow", "occlusion") for cls in FAMILIES[family].members.values()}
    overlaid |= set(IN_WORDS.values())
    # Functions of shapes, which a field's bindings import by name, are beside what they are described by.
    overlaid |= {f"package::sdf::{path.stem}" for path in Path(tyndall.sdf.__file__).parent.glob("*.py")}
    # One of the two is what a world's bindings import.
    overlaid |= {"package::tracing::fields", "package::tracing::no_fields"}
    for module in texts.keys() - roots - overlaid:
        users = [m for m, text in texts.items() if re.search(rf"import {module}\b", text)]
        assert users, f"{module} is imported nowhere"


@pytest.mark.parametrize("family", FAMILIES)
def test_a_technique_has_its_shader_beside_it(gpu: Gpu, family: str) -> None:
    for cls in FAMILIES[family].members.values():
        if cls.name != "none" or family == "tonemap":
            assert cls.shader() in gpu.linker.modules
