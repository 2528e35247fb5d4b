"""Implicit surfaces in a frame: where they are, what they look like, and their shadows by every technique, against the
closed form of a sphere and against meshes of the same."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE, shoot

from tyndall.content.implicit import Fields, materials_of
from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, fields_of
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Implicit,
    Instance,
    Light,
    Material,
    Medium,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
)
from tyndall.sdf import box, sphere, union
from tyndall.techniques import FAMILIES
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.march import March

SIZE = (96, 72)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
RADIUS, CENTRE = 0.7, (0.1, 1.1, -0.2)
QUIET: dict[str, Any] = {"volumetric": "off", "shadow": ShadowMap(size=16), "antialiasing": "none"}


def drawn(gpu: Gpu, scene: Scene, *, casters: bool = True, **more: Any) -> np.ndarray:
    """The surfaces' light."""
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", **more) as renderer:
        renderer.draw(casters=casters)
        return renderer.base()


def at(x: float, y: float, z: float) -> Any:
    """A transform that moves."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def ball(material: Material = WHITE, rings: int = 96) -> Mesh:
    """A sphere of RADIUS around 0 as a mesh whose chords are 0.05 % off."""
    polar, azimuth = np.linspace(0, math.pi, rings + 1), np.linspace(0, 2 * math.pi, 2 * rings, endpoint=False)
    y, ring = np.cos(polar)[:, None], np.sin(polar)[:, None]
    grid = np.stack([ring * np.sin(azimuth), np.broadcast_to(y, (rings + 1, 2 * rings)), ring * np.cos(azimuth)], -1)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    k = (j + 1) % (2 * rings)
    a, b, c, d = (row * 2 * rings + column for row, column in ((i, j), (i + 1, j), (i + 1, k), (i, k)))
    indices = np.concatenate([np.stack(corners, -1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    normals = grid.reshape(-1, 3)
    return Mesh(RADIUS * normals, indices, normals, material=material)


def both(lights: list[Light], **more: Any) -> tuple[Scene, Scene]:
    """A sphere over a floor: as an implicit surface, and as a mesh."""
    floor = props.floor(0, 4)
    implicit = Scene([floor], lights, ABOVE, implicits=[Implicit(sphere(RADIUS), at(*CENTRE), WHITE)], **more)
    return implicit, Scene([floor, Instance(ball(), at(*CENTRE))], lights, ABOVE, **more)


def test_depth_and_normals_are_a_spheres(gpu: Gpu) -> None:
    scene = Scene(camera=ABOVE, implicits=[Implicit(sphere(RADIUS), at(*CENTRE), WHITE)])
    seen = props.rays(ABOVE, SIZE)
    way = np.array(CENTRE) - ABOVE.position
    along = seen.directions @ way
    off = way @ way - along**2
    distance = along - np.sqrt(np.maximum(RADIUS**2 - off, 0))
    inside = off < (0.98 * RADIUS) ** 2
    with Renderer(scene, SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        depth = renderer.depth() * seen.stretch
        normals = gpu.read_texture(renderer._images["normal_roughness"])[..., :3].astype(float)
    assert 200 < inside.sum() < 3000
    pixel = 2 * math.tan(ABOVE.fov / 2) / SIZE[1] * distance
    cosine = np.sqrt(np.maximum(1 - off / RADIUS**2, 0.01))
    assert (np.abs(depth - distance) < 0.5 * pixel / cosine)[inside].all()
    assert np.isinf(depth[off > (RADIUS + pixel.max()) ** 2]).all()
    expected = (seen.at(np.where(inside, distance, 1)) - CENTRE) / RADIUS
    assert np.sum(normals * expected, -1)[inside].min() > 0.98, "they are of a place up to half a pixel off"
    assert np.median(np.sum(normals * expected, -1)[inside]) > 0.9995


def test_from_afar_normals_are_a_spheres(gpu: Gpu) -> None:
    """Where pixels are wider than the cells of a program, and meet the surface where cells have none."""
    shells = union(*(sphere(r) for r in np.linspace(0.2, RADIUS, 12)))
    far = Camera((0, 0, 40), (0, 0, 0), fov=0.1)
    with Renderer(Scene(camera=far, implicits=[Implicit(shells)]), SIZE, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        seen = np.isfinite(renderer.depth())
        normals = gpu.read_texture(renderer._images["normal_roughness"])[..., :3].astype(float)
    y, x = np.indices(seen.shape)
    places = np.stack([x + 0.5 - SIZE[0] / 2, SIZE[1] / 2 - y - 0.5], -1) * 2 * 40 * math.tan(far.fov / 2) / SIZE[1]
    inside = np.hypot(*np.moveaxis(places, -1, 0)) < 0.8 * RADIUS
    assert 100 < inside.sum() < 400
    assert seen[inside].all()
    expected = np.concatenate([places, np.sqrt(np.maximum(RADIUS**2 - (places**2).sum(-1, keepdims=True), 0))], -1)
    assert np.sum(normals * expected / RADIUS, -1)[inside].min() > 0.99


def test_the_nearer_of_mesh_and_surface_is_seen(gpu: Gpu) -> None:
    """A wall through the sphere's middle hides its back half, and is hidden by its front half."""
    red, green = (Material(base_color=(*color, 1), roughness=1) for color in ((1, 0, 0), (0, 1, 0)))
    for z, shown in ((-3.0, red), (-1.0, green)):
        scene = Scene(
            [props.wall(z, 1.0, green)], [], props.AHEAD, ambient=(1, 1, 1),
            implicits=[Implicit(sphere(0.6), at(0, 0, -2.0), red)],
        )  # fmt: skip
        middle = shoot(gpu, scene, props.TINY).base[6, 8]
        np.testing.assert_allclose(middle, shown.base_color[:3], atol=0.01)


def test_the_material_is_an_objects_own(gpu: Gpu) -> None:
    shine = Material(base_color=(0.2, 0.5, 0.9, 1), metallic=0.25, roughness=0.4, emissive=(0.5, 3, 0.25))
    matt = Material(base_color=(0.9, 0.04, 0.0, 1), roughness=0.9)
    objects = [Implicit(sphere(0.4), at(x, 0, -2), material) for x, material in ((-0.6, shine), (0.6, matt))]
    with Renderer(Scene(camera=props.AHEAD, implicits=objects), props.TINY, gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        row = {
            name: gpu.read_texture(renderer._images[name])[6].astype(float)
            for name in ("normal_roughness", "albedo_metallic", "emissive")
        }
    for column, material in ((4, shine), (11, matt)):
        albedo = row["albedo_metallic"][column] / 255
        np.testing.assert_allclose(albedo[:3] ** 2, material.base_color[:3], atol=0.004)
        np.testing.assert_allclose(albedo[3], material.metallic, atol=0.003)
        np.testing.assert_allclose(row["normal_roughness"][column, 3], material.roughness, atol=1e-3)
        np.testing.assert_allclose(row["emissive"][column, :3], material.emissive, atol=1e-3)
    assert not any(row[name][[0, 7, 8]].any() for name in row), "the background stays empty"


LIGHTS = [
    pytest.param(DirectionalLight((0.5, -1.0, -0.35), 3.0), id="directional"),
    pytest.param(PointLight((-1.2, 3.2, 0.9), 20.0), id="point"),
]


@pytest.mark.parametrize("name", FAMILIES["shadow"].members)
@pytest.mark.parametrize("light", LIGHTS)
def test_every_shadow_technique_shows_the_shadow_of_the_same_mesh(gpu: Gpu, name: str, light: Light) -> None:
    """On the floor and on the sphere itself; a technique that shades planes alone leaves the sphere lit in both."""
    technique = FAMILIES["shadow"].make(name)
    sizes = {f.name: 256 for f in fields_of(type(technique)) if f.name in ("size", "map_size")}
    shadow = FAMILIES["shadow"].make(name, changes={**sizes, **SHARP.get(name, {})})
    implicit, mesh, full = (
        drawn(gpu, scene, shadow=shadow, casters=casters)[..., 0]
        for scene, casters in zip((*both([light]), both([light])[0]), (True, True, False), strict=True)
    )
    dark = (implicit < 0.2 * full) & (full > 0)
    assert dark.sum() > 60
    off = np.abs(implicit - mesh) > 0.05 * full.max()
    assert off.mean() < 0.015, "edges aside, they are the same"
    inner = dark & np.all([np.roll(dark, step, axis) for step in (-1, 1) for axis in (0, 1)], axis=0)
    assert off[inner].mean() < 0.05


SHARP: dict[str, dict[str, Any]] = {
    **{name: {"radius": 1.0} for name in ("vsm", "esm", "evsm", "pcf")},
    "blurred": {"radius": 1, "sigma": 0.5, "depth_aware": True},
}


@pytest.mark.parametrize("name", [name for name in FAMILIES["volumetric"].members if name != "off"])
def test_every_volumetric_technique_is_blocked_by_it(gpu: Gpu, name: str) -> None:
    """As by the same mesh, and not as without either."""
    light = SpotLight((0.1, 4.5, -0.2), (0, -1, 0), 60.0, (1, 1, 1), 0.4, 0.5)
    changes = {"march": {"steps": 48}, "froxel": {"grid": (48, 36, 48)}}.get(name, {})
    technique = FAMILIES["volumetric"].make(name, changes=changes)
    air = Medium(0.1, 0.01, bounds=((-3, 0, -3), (3, 5, 3)))
    shots = [
        shoot(gpu, scene, (48, 36), volumetric=technique, shadow=ShadowMap(size=256)).inscattered[..., 0]
        for scene in (*both([light], medium=air), Scene([props.floor(0, 4)], [light], ABOVE, air))
    ]
    implicit, mesh, without = shots
    error = np.abs(implicit - mesh).mean() / mesh.mean()
    change = np.abs(without - mesh).mean() / mesh.mean()
    assert change > 0.05
    assert error < 0.25 * change


def test_a_marched_shaft_is_dark_behind_it(gpu: Gpu) -> None:
    """The air in the sphere's shadow gets no light at all."""
    light = DirectionalLight((0, 0, -1), 5.0)
    camera = Camera((0, 3, -2), (0, 0, -2), up=(0, 0, -1), fov=0.2, near=0.05)
    medium = Medium(0.1, 0.0, bounds=((-0.3, -0.3, -2.3), (0.3, 0.3, -1.7)))
    scene = Scene([props.wall(-4)], [light], camera, medium, implicits=[Implicit(sphere(0.6), name="ball")])
    shot = shoot(gpu, scene, props.TINY, volumetric=March(steps=32, jitter=0), shadow=ShadowMap(size=512))
    assert shot.inscattered.max() == 0


# --- motion -------------------------------------------------------------------------------------------------------


def test_a_placed_object_is_drawn_where_it_is(gpu: Gpu) -> None:
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    objects = [Implicit(sphere(0.3), at(-1, 0.5, 0), WHITE, "left"), Implicit(sphere(0.3), at(1, 0.5, 0), WHITE)]
    room = ((-4.0, 0.0, -4.0), (4.0, 3.0, 4.0))
    scene = Scene([props.floor(0, 4)], [light], ABOVE, implicits=objects, room=room)
    there = scene.with_(implicits=[Implicit(sphere(0.3), at(-0.2, 1.2, 0.8), WHITE), objects[1]])
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none") as renderer:
        renderer.draw()
        first = renderer.uploaded
        renderer.draw()
        assert (renderer.uploaded, first > 0) == (0, True), "what stands still is sent once"
        renderer.place("left", at(-0.2, 1.2, 0.8))
        renderer.draw()
        assert 0 < renderer.uploaded < first
        np.testing.assert_array_equal(renderer.base(), drawn(gpu, there))
        renderer.move("left", [(0, 0, 0)])
        renderer.draw()
        np.testing.assert_array_equal(renderer.base(), drawn(gpu, scene))
        with pytest.raises(ParameterError, match="did you mean 'left'"):
            renderer.place("lefd", np.eye(4))
        with pytest.raises(ParameterError, match="no 2"):
            renderer.place(2, np.eye(4))
        with pytest.raises(ParameterError, match="neither of 4×4 transforms"):
            renderer.move("left", [1, 2])
        with pytest.raises(ParameterError, match="left: 2 transforms for 1 object"):
            renderer.move("left", [(0, 0, 0), (0, 0, 0)])
        with pytest.raises(ParameterError, match=r"shape \(3, 3\) is not \(4, 4\)"):
            renderer.place(0, np.eye(3))
        with pytest.raises(ParameterError, match="last row"):
            renderer.place(0, np.eye(4) + np.eye(4)[[3, 0, 1, 2]])


def test_an_edited_part_is_drawn_as_it_is(gpu: Gpu) -> None:
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)

    def made(radius: float) -> Scene:
        shape = sphere(radius).named("ball") | sphere(0.2).at(1)
        room = ((-4.0, 0.0, -4.0), (4.0, 3.0, 4.0))
        return Scene([props.floor(0, 4)], [light], ABOVE, implicits=[Implicit(shape, at(0, 0.6, 0), WHITE)], room=room)

    with Renderer(made(0.2), SIZE, gpu=gpu, volumetric="off", antialiasing="none") as renderer:
        renderer.draw()
        renderer.edit("ball", radius=0.5)
        renderer.draw()
        apart = np.abs(renderer.base() - drawn(gpu, made(0.5))).max(axis=-1) > 0.01
        assert apart.mean() < 0.02, "but for outlines: it has other cells"
        with pytest.raises(ParameterError, match="did you mean 'ball'"):
            renderer.edit("bal", radius=0.5)
        with pytest.raises(ParameterError, match="radius: -1 is outside"):
            renderer.edit("ball", radius=-1)


def test_a_frame_that_failed_is_not_missed(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it would have sorted into cells is sorted by the next one."""
    beads = union(*(sphere(0.2).at(0.3 * i - 1) for i in range(9)))
    scene = Scene(
        (), [DirectionalLight((0.5, -1.0, -0.35), 3.0)], ABOVE, implicits=[Implicit(beads, at(0, 0.5, 0), WHITE)]
    )
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none") as renderer:
        with monkeypatch.context() as patch:
            patch.setattr(ShadowMap, "render", lambda *_: 1 / 0)
            with pytest.raises(ZeroDivisionError):
                renderer.draw()
        renderer.draw()
        np.testing.assert_array_equal(renderer.base(), drawn(gpu, scene))


@pytest.mark.parametrize("shadow", ["shadow_map", "projective"])
def test_maps_are_fitted_anew_where_an_object_leaves_the_scene(gpu: Gpu, shadow: str) -> None:
    """Its shadow is not lost."""
    scene = Scene(
        [props.floor(0, 4)], [DirectionalLight((0.02, -1.0, 0.01), 3.0)], ABOVE,
        implicits=[Implicit(sphere(0.5), at(0, 0.5, 0), WHITE, "ball")],
    )  # fmt: skip
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", shadow=shadow) as renderer:
        renderer.draw()
        renderer.place("ball", at(0, 9.0, 0))
        renderer.draw()
        high = renderer.base()[..., 0]
        assert renderer.scene.bounds[1][1] > 9.5
    seen = props.rays(ABOVE, SIZE)
    floor = seen.at(-ABOVE.position[1] / seen.directions[..., 1])
    off = np.hypot(floor[..., 0] - 0.17, floor[..., 2] - 0.085)
    assert (high[off < 0.42] == 0).all()
    assert (high[(off > 0.6) & (off < 1.5)] > 0.5).all()


def test_a_moment_is_the_same_live_and_still(gpu: Gpu) -> None:
    def motion(time: float) -> dict[str, Any]:
        return {"ball": [(math.sin(time), 0.2 * time, 0.0)]}

    scene = Scene(
        [props.floor(0, 4)], [DirectionalLight((0.5, -1.0, -0.35), 3.0)], ABOVE,
        implicits=[Implicit(sphere(0.5), at(0, 0.6, 0), WHITE, "ball")], motion=motion,
        room=((-4, 0, -4), (4, 3, 4)),
    )  # fmt: skip
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none") as renderer:
        for time in (0.0, 1.3):
            renderer.draw(time=time)
            np.testing.assert_array_equal(renderer.base(), drawn(gpu, scene.at_time(time)))
        renderer.draw(time=1.3)
        assert renderer.uploaded == 0


def test_what_moves_leaves_no_trail(gpu: Gpu) -> None:
    """Where a bright ball was, the background is there again after few frames, however still the camera."""
    glow = Material(emissive=(4, 4, 4))
    scene = Scene(camera=props.AHEAD, implicits=[Implicit(sphere(0.3), at(-0.5, 0, -2), glow, "ball")])
    with Renderer(scene, (64, 48), gpu=gpu, volumetric="off", shadow=ShadowMap(size=16)) as renderer:
        for _ in range(12):
            renderer.draw()
        renderer.move("ball", [(1.0, 0, 0)])
        renderer.draw()
        assert renderer.radiance()[:, :32].max() < 0.05
        assert renderer.radiance()[24, 48].min() > 3


_MOTION = """
    import package::wesl::motion::motion_of;
    fn evaluate(x: vec4f) -> vec4f {
        return vec4f(motion_of(vec2u(x.xy)), 0.0, 0.0);
    }
"""


def test_an_objects_motion_is_told_from_that_of_the_camera(gpu: Gpu) -> None:
    """It moved by 0.1 m at 2 m and turned about the view's axis; the wall behind it stood still."""
    turn = np.array([[0, -1, 0, 0.1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    ball = Implicit(sphere(0.3), at(0, 0, -2.0), WHITE, "ball")
    scene = Scene([props.wall(-4)], camera=props.AHEAD, implicits=[ball])
    pixels = np.array([(32, 24, 0, 0), (32, 20, 0, 0), (4, 4, 0, 0)], np.float32)
    with Renderer(scene, (64, 48), gpu=gpu, **QUIET) as renderer:
        renderer.draw()
        renderer.move("ball", turn)
        renderer.draw()
        moved = props.evaluate(gpu, "motion_moved", _MOTION, pixels, renderer._scope)[:, :2]
        renderer.draw()
        still = props.evaluate(gpu, "motion_still", _MOTION, pixels, renderer._scope)[:, :2]
    seen = props.rays(props.AHEAD, (64, 48)).directions
    height = 2 * math.tan(props.AHEAD.fov / 2)
    for row, (x, y) in zip(moved, ((32, 24), (32, 20)), strict=False):
        d = seen[y, x]
        off = np.array((0, 0, -2.0)) + (0.1, 0, 0)
        along = d @ off
        place = d * (along - math.sqrt(along**2 - off @ off + 0.09))
        before = np.linalg.inv(turn) @ (*place, 1.0)
        step = place[:2] / -place[2] - before[:2] / -before[2]
        np.testing.assert_allclose(row, step / (height * 64 / 48, -height), atol=0.004)
    np.testing.assert_allclose(moved[2], 0, atol=1e-7)  # of the picture's size: rounding, on some devices
    np.testing.assert_allclose(still, 0, atol=1e-7)


def test_the_motion_of_parts_is_told_from_that_of_their_object(gpu: Gpu) -> None:
    """A leaf is turned, several leaves are moved, and what is mirrored moves the other way; then all stand still."""
    several = union(box(0.4), sphere(0.25)).named("several").at(0, 0.6)
    shape = union(sphere(0.3).named("leaf"), several, sphere(0.2).at(0.8).named("twin").mirror("x"))
    scene = Scene(camera=props.AHEAD, implicits=[Implicit(shape, at(0, 0, -3.0), WHITE, "all")])
    spin = np.array([[0, -1, 0, 0.05], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    moves = {"leaf": spin, "several": at(0, 0.1, 0), "twin": at(0.06, 0, 0), "all": at(0.02, 0, 0)}
    plain = {**QUIET, "antialiasing": "taa"}
    with Renderer(scene, (64, 48), gpu=gpu, **plain) as renderer:
        renderer.draw(jitter=False)
        for name, matrix in moves.items():
            renderer.move(name, matrix)
        renderer.draw(jitter=False)
        assert renderer._fields is not None
        assert renderer._fields._flow is not None
        ways = gpu.read_texture(renderer._fields._flow)[..., :3].astype(float)
        depth = renderer.depth()
        pixels = np.array([(34, 20, 0, 0)], np.float32)
        seen = props.evaluate(gpu, "motion_parts", _MOTION, pixels, renderer._scope)[0, :2]
        renderer.draw(jitter=False)
        still = props.evaluate(gpu, "motion_parts_still", _MOTION, pixels, renderer._scope)[0, :2]
    directions = props.rays(props.AHEAD, (64, 48)).directions
    places = directions / -directions[..., 2:] * depth[..., None]
    x, y = places[..., 0], places[..., 1]
    with np.errstate(invalid="ignore"):
        found = np.isfinite(depth)
        masks = {
            "leaf": found & (np.hypot(x - 0.07, y) < 0.3),
            "several": found & (y > 0.45),
            "right": found & (x > 0.6),
            "left": found & (x < -0.6),
        }
    assert all(mask.sum() > 20 for mask in masks.values())
    for name, way in (("several", (-0.02, -0.1, 0)), ("right", (-0.08, 0, 0)), ("left", (0.04, 0, 0))):
        np.testing.assert_allclose(ways[masks[name]], np.broadcast_to(way, ways[masks[name]].shape), atol=1e-3)
    here = places[masks["leaf"]]
    local = here - (0.02, 0, -3)
    before = np.stack([local[:, 1], 0.05 - local[:, 0], local[:, 2]], -1) + (0, 0, -3)
    np.testing.assert_allclose(ways[masks["leaf"]], before - here, atol=2e-3)
    p = places[20, 34]
    then = p + ways[20, 34]
    height = 2 * math.tan(props.AHEAD.fov / 2)
    step = p[:2] / -p[2] - then[:2] / -then[2]
    np.testing.assert_allclose(seen, step / (height * 64 / 48, -height), atol=2e-3)
    np.testing.assert_array_equal(still, 0)


def test_materials_are_found_in_all_parts() -> None:
    one, two = Material("one"), Material("two")
    shape = sphere(1).material(one) | sphere(2).at(1, 0, 0)
    assert [m.name for m in materials_of(Implicit(shape, material=two))] == ["two", "one"]


def test_maps_that_are_equally_wide_are_not_one(gpu: Gpu) -> None:
    fields = Fields(gpu, both([])[0], SIZE)
    sizes = (16, 16), (16, 8), (8, 16)
    try:
        assert [fields._map(size).size[:2] for size in sizes] == list(sizes)
        assert fields._map((16, 8)) is fields._map((16, 8))
    finally:
        fields.close()


def test_closing_frees_everything(gpu: Gpu) -> None:
    before = gpu.ledger.total
    fields = Fields(gpu, both([])[0], SIZE)
    assert gpu.ledger.total > before
    assert sum(resource.size_bytes for resource in fields.resources()) == gpu.ledger.total - before
    fields.close()
    assert gpu.ledger.total == before
