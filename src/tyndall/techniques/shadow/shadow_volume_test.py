"""Shadow volumes: counts against rays, from anywhere, for whatever meshes and lights there are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE, shoot

from tyndall.gpu.device import Gpu
from tyndall.scene import bundled as scenes
from tyndall.scene.bundled import primitives
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Image,
    Instance,
    Light,
    Material,
    Mesh,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
    Texture,
)
from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_volume import ShadowVolume

SIZE = (96, 72)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
TWO_SIDED = replace(WHITE, double_sided=True)
FLOOR = props.floor(0, 4)
CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))
SHEET = props.quad((-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1), TWO_SIDED)
POINT = PointLight((-1.2, 2.2, 0.9), 20.0)
SUN = DirectionalLight((0.5, -1.0, -0.35), 3.0)
ROOM = props.box((-3, 0, -3), (3, 4, 3), TWO_SIDED)
IN_ROOM = Camera((-2.5, 3.5, -2.4), (2.0, 0.8, 2.1), fov=1.5, near=0.05)
ZFAIL, ZPASS = ShadowVolume(), ShadowVolume(method="zpass")


def turned_over(instance: Instance) -> Instance:
    """The same triangles wound, and shaded, the other way."""
    mesh = instance.mesh
    assert mesh.normals is not None
    return Instance(replace(mesh, indices=mesh.indices[:, ::-1], normals=-mesh.normals), instance.transform)


def painted(instance: Instance, material: Material) -> Instance:
    return Instance(replace(instance.mesh, material=material), instance.transform)


def with_triangles(instance: Instance, *more: tuple[int, int, int]) -> Instance:
    return Instance(replace(instance.mesh, indices=np.concatenate([instance.mesh.indices, np.array(more)])))


def without_last(instance: Instance, count: int) -> Instance:
    return Instance(replace(instance.mesh, indices=instance.mesh.indices[:-count]))


def placed(instance: Instance, *rows: tuple[float, float, float]) -> Instance:
    matrix = np.eye(4)
    matrix[:3, :3] = rows
    return Instance(instance.mesh, matrix.tolist())


def drawn(gpu: Gpu, scene: Scene, technique: Technique, size: tuple[int, int] = SIZE) -> np.ndarray:
    base = shoot(gpu, scene, size, shadow=technique).base
    assert np.isfinite(base).all()
    return base


def share_as_rays(gpu: Gpu, scene: Scene, technique: Technique = ZFAIL, size: tuple[int, int] = SIZE) -> float:
    """The share of what the camera sees, of all surfaces, that is drawn as by rays."""
    shot = shoot(gpu, scene, size, shadow=RayTraced())
    base = drawn(gpu, scene, technique, size)
    unlike = np.abs(base - shot.base).max(axis=-1) > 0.02 * max(shot.base.max(), 1e-3)
    return float(1 - unlike[np.isfinite(shot.depth)].mean())


def shaded_share(gpu: Gpu, scene: Scene) -> float:
    """The share of the surfaces that rays say is dark; so that a test knows that there is a shadow to see."""
    shot = shoot(gpu, scene, SIZE, shadow=RayTraced())
    return float((shot.base[np.isfinite(shot.depth)] == 0).mean())


# --- the two ways to count -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(scenes.shadows(triangles=1000), id="shadows"),  # type: ignore[call-arg]
        pytest.param(Scene([FLOOR, CUBE], [SUN, POINT], ABOVE), id="cube"),
        pytest.param(Scene([FLOOR, SHEET, CUBE], [POINT, replace(SUN, direction=(1, -0.35, 0.2))], ABOVE), id="open"),
    ],
)
def test_both_counts_agree_where_the_eye_is_outside_of_all_volumes(gpu: Gpu, scene: Scene) -> None:
    """Every pixel of the whole picture."""
    before, beyond = (drawn(gpu, scene, technique) for technique in (ZPASS, ZFAIL))
    np.testing.assert_array_equal(before, beyond)
    unshaded = drawn(gpu, scene.with_(instances=[scene.instances[0]]), ZFAIL)
    assert (np.abs(before - unshaded) > 0.05).any(axis=-1).mean() > 0.05


@pytest.mark.parametrize(
    ("light", "target"), [(SUN, (2, 0.0, -2)), (POINT, (1.5, 0, 1.5))], ids=["directional", "point"]
)
def test_within_a_volume_only_the_count_beyond_is_right(
    gpu: Gpu, light: Light, target: tuple[float, float, float]
) -> None:
    camera = Camera((0.2, 0.2, -0.1), target, fov=1.2, near=0.02)
    scene = Scene([FLOOR, CUBE], [light], camera)
    assert not props.lit(scene, light, np.array([camera.position])).any(), "the eye must be in shadow"
    assert 0.05 < shaded_share(gpu, scene) < 0.95
    assert share_as_rays(gpu, scene, ZFAIL) >= 0.999
    assert share_as_rays(gpu, scene, ZPASS) < 0.5


def test_a_shadow_reaches_behind_the_camera(gpu: Gpu) -> None:
    """Volumes go to infinity, through and behind the eye."""
    camera = Camera((-0.9, 0.3, -0.6), (-2.5, 0, -1), fov=1.9, near=0.02)
    light = PointLight((1.2, 2.2, 0.9), 20.0)
    scene = Scene([FLOOR, CUBE], [light], camera)
    assert not props.lit(scene, light, np.array([camera.position])).any(), "the eye must be in shadow"
    assert 0.05 < shaded_share(gpu, scene) < 0.95
    assert share_as_rays(gpu, scene) >= 0.999


# --- against rays --------------------------------------------------------------------------------------------------


def torus() -> Instance:
    knot = primitives.torus_knot((2, 3), (0.8, 0.35, 0.22), 160, 16)
    return Instance(knot.at(0, 1.3, 0).mesh(WHITE, "knot"))


def small_ball() -> Instance:
    return Instance(primitives.ball(0.6, 64, 32).at(0, 0.9, 0).mesh(WHITE, "ball"))


@pytest.mark.parametrize("name", ["shadows", "interior", "torus", "ball"])
def test_the_shadow_is_that_of_rays_up_to_its_edge(gpu: Gpu, name: str) -> None:
    """99.9 % of all pixels, of faceted, curved and open things, seen from outside and from inside of a volume."""
    match name:
        case "shadows":
            scene = scenes.shadows(triangles=1000)  # type: ignore[call-arg]
        case "interior":
            scene = scenes.interior()
            scene = scene.with_(lights=[replace(light, radius=0.0) for light in scene.lights])  # type: ignore[call-arg]
        case "torus":
            scene = Scene([FLOOR, torus()], [POINT], ABOVE)
        case _:
            scene = Scene([FLOOR, small_ball()], [SUN], ABOVE)
    assert share_as_rays(gpu, scene, size=(192, 108)) >= 0.999


MIXED = Instance(
    Mesh(
        np.array([[0, 0.5, -1], [0, 0.5, 1], [1, 1, 0], [-1, 1, 0], [0, 1.5, 0]]),
        np.array([[0, 1, 2], [0, 1, 3], [1, 0, 4]]),
        material=TWO_SIDED,
    )
)
SHAPES = {
    "a sheet": SHEET,
    "a sheet that faces away": turned_over(SHEET),
    "a box without a side": painted(without_last(CUBE, 2), TWO_SIDED),
    "a box with a hole": painted(without_last(CUBE, 1), TWO_SIDED),
    "an edge of three triangles": MIXED,
    "triangles without area": with_triangles(CUBE, (0, 0, 1), (2, 2, 2), (0, 1, 1)),
    "every triangle twice": with_triangles(CUBE, *map(tuple, CUBE.mesh.indices.tolist())),
    "inside out": turned_over(CUBE),
    "inside out and two-sided": painted(turned_over(CUBE), TWO_SIDED),
    "mirrored": placed(CUBE, (-1, 0.3, 0), (0, 1, 0), (0, 0, 1)),
    "mirrored and open": placed(SHEET, (-1, 0.3, 0), (0, 1, 0), (0, 0, 1)),
    "scaled unevenly": placed(CUBE, (-1.7, 0.2, 0), (0, 0.6, 0.1), (0.3, 0, 1.2)),
    "flattened": placed(painted(CUBE, TWO_SIDED), (1, 0, 0), (0, 1, 0), (0, 0, 0)),
    "shared vertices": Instance(primitives.ball(0.6, 12, 6).at(0, 0.9, 0).mesh(WHITE, "ball")),
}


@pytest.mark.parametrize("light", [SUN, POINT], ids=["directional", "point"])
@pytest.mark.parametrize("shape", SHAPES)
def test_any_mesh_casts_as_rays_see_it(gpu: Gpu, shape: str, light: Light) -> None:
    scene = Scene([FLOOR, SHAPES[shape]], [light], ABOVE)
    assert shaded_share(gpu, scene) > 0.005
    assert share_as_rays(gpu, scene) >= 0.999


def test_the_same_mesh_many_times(gpu: Gpu) -> None:
    """Instances share edges and have a place each; some are mirrored, some stand in one another."""
    rng = np.random.default_rng(3)
    small = props.box((-0.15, -0.15, -0.15), (0.15, 0.15, 0.15)).mesh
    instances = []
    for i in range(60):
        matrix = np.eye(4)
        matrix[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * (-1 if i % 3 else 1)
        matrix[:3, 3] = rng.uniform((-1.5, 0.3, -1.5), (1.5, 1.5, 1.5))
        instances.append(Instance(small, matrix.tolist()))
    scene = Scene([FLOOR, *instances], [POINT], ABOVE)
    assert 0.1 < shaded_share(gpu, scene) < 0.9
    assert share_as_rays(gpu, scene) >= 0.995  # sixty times as many edges


# --- where lights may be -------------------------------------------------------------------------------------------

OPEN_BOX = SHAPES["a box without a side"]
INSIDE_OUT_ROOM = turned_over(painted(ROOM, WHITE))


@pytest.mark.parametrize(
    ("instances", "light", "camera", "dark"),
    [
        pytest.param([ROOM, CUBE], POINT, IN_ROOM, 0.5, id="inside of a closed box: its inside is lit"),
        pytest.param([INSIDE_OUT_ROOM, CUBE], POINT, IN_ROOM, 0.5, id="inside of a box wound inside out"),
        pytest.param([FLOOR, CUBE], PointLight((0, 0.9, 0), 5.0), ABOVE, 1.0, id="inside of a box: outside is dark"),
        pytest.param([ROOM, CUBE], PointLight((0, 6, 0), 50.0), IN_ROOM, 1.0, id="outside of a closed box"),
        pytest.param([INSIDE_OUT_ROOM, CUBE], PointLight((0, 6, 0), 50.0), IN_ROOM, 1.0, id="outside of that"),
        pytest.param([INSIDE_OUT_ROOM, CUBE], SUN, IN_ROOM, 1.0, id="the sun outside, wound inside out"),
        pytest.param([FLOOR, OPEN_BOX], PointLight((0, 0.9, 0), 5.0), ABOVE, 0.95, id="inside of an open box"),
        pytest.param([FLOOR, CUBE], PointLight((0.1, 0.4, 0.17), 5.0), ABOVE, 0.5, id="in the lower side of a box"),
        pytest.param([FLOOR, CUBE], PointLight((0.5, 1.4, 0.1), 5.0), ABOVE, 0.9, id="in an edge"),
        pytest.param([FLOOR, CUBE], PointLight((0.5, 1.4, 0.0), 5.0), ABOVE, 0.9, id="in an edge's middle"),
        pytest.param([FLOOR, CUBE], PointLight((0.5, 1.4, 0.5), 5.0), ABOVE, 0.5, id="at a vertex"),
        pytest.param([FLOOR, SHEET], PointLight((0.1, 1, 0.3), 5.0), ABOVE, 0.3, id="in a sheet"),
        pytest.param([FLOOR, CUBE], PointLight((1, 0, 1), 5.0), ABOVE, 1.0, id="in the floor"),
        pytest.param([FLOOR, CUBE], PointLight((-4e5, 9e5, 1e5), 1e13), ABOVE, 0.5, id="a thousand kilometres away"),
    ],
)  # fmt: skip
def test_a_light_anywhere(gpu: Gpu, instances: list[Instance], light: Light, camera: Camera, dark: float) -> None:
    """``dark``: what of the picture may be so at most."""
    scene = Scene(instances, [light], camera)
    assert shaded_share(gpu, scene) <= dark
    assert share_as_rays(gpu, scene) >= 0.999


@pytest.mark.parametrize("above", [0.0, 1e-6, 1e-4])
@pytest.mark.parametrize("x", [0.17, 0.1], ids=["in a triangle", "in a diagonal"])
def test_what_is_beneath_a_light_in_a_surface_is_dark_and_what_is_above_is_lit(
    gpu: Gpu, above: float, x: float
) -> None:
    """Just above a box the whole floor is hidden, and a ceiling is lit."""
    ceiling = props.quad((-4, 4, -4), (4, 4, -4), (4, 4, 4), (-4, 4, 4))
    light = PointLight((x, 1.4 + above, 0.1), 5.0)
    down = Scene([FLOOR, props.box((-4, 1, -4), (4, 1.4, 4)), ceiling], [light], Camera((2.5, 0.8, 4.5), (0, 0.3, 0)))
    up = down.with_(camera=Camera((2.5, 2.2, 3.5), (0, 3.8, 0)))
    assert not drawn(gpu, down, ZFAIL).any()
    assert (drawn(gpu, up, ZFAIL)[:24, ..., 0] > 0.01).mean() > 0.9
    assert share_as_rays(gpu, up) > 0.99


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("light", [SUN, POINT], ids=["directional", "point"])
def test_scale_changes_nothing(gpu: Gpu, light: Light, scale: float) -> None:
    def scaled(instance: Instance) -> Instance:
        return Instance(replace(instance.mesh, positions=instance.mesh.positions * scale))

    def point(p: Any) -> Any:
        return tuple(scale * np.array(p))

    large = light
    if isinstance(light, PointLight):
        large = replace(light, position=point(light.position), intensity=light.intensity * scale**2)
    camera = replace(ABOVE, position=point(ABOVE.position), target=point(ABOVE.target), near=ABOVE.near * scale)
    one = drawn(gpu, Scene([FLOOR, CUBE, SHEET], [light], ABOVE), ZFAIL)
    other = drawn(gpu, Scene([scaled(i) for i in (FLOOR, CUBE, SHEET)], [large], camera), ZFAIL)
    assert (np.abs(one - other) > 0.01 * one.max()).any(axis=-1).mean() <= 0.001


def test_many_lights_are_each_alone(gpu: Gpu) -> None:
    """Light adds: 64 lights of all kinds, four to a texel of the masks, draw the sum of what each of them does."""
    rng = np.random.default_rng(5)
    lights: list[Light] = []
    for i in range(64):
        position = tuple(rng.uniform((-2, 1.7, -2), (2, 3, 2)))
        down = (float(rng.uniform(-0.5, 0.5)), -1.0, float(rng.uniform(-0.5, 0.5)))
        kinds: list[Light] = [
            PointLight(position, 0.2),
            DirectionalLight(down, 0.05),
            SpotLight(position, down, 0.4),
            RectLight(position, down, 0.3, width=1e-3, height=1e-3),
        ]
        lights.append(kinds[i % 4])
    scene = Scene([FLOOR, CUBE, SHEET], lights, ABOVE)
    size = (48, 36)
    alone = sum(drawn(gpu, scene.with_(lights=[light]), ZFAIL, size) for light in lights)
    together = drawn(gpu, scene, ZFAIL, size)
    np.testing.assert_allclose(together, alone, atol=0.01 * float(np.max(alone)))
    assert share_as_rays(gpu, scene, size=size) >= 0.99


# --- counters ------------------------------------------------------------------------------------------------------


def stack(count: int) -> Scene:
    """Sheets above a floor, all in one shadow."""
    sheets = [props.quad((-3, y, 3), (3, y, 3), (3, y, -3), (-3, y, -3)) for y in np.linspace(1, 2, count)]
    return Scene([FLOOR, *sheets], [DirectionalLight((0.1, -1, 0.05), 3.0)], Camera((0, 0.5, 0.6), (0, 0, 0)))


@pytest.mark.parametrize(("count", "is_lit"), [(1, False), (255, False), (256, True), (257, False), (300, False)])
def test_a_counter_wraps_at_256_volumes_and_nowhere_else(gpu: Gpu, count: int, is_lit: bool) -> None:
    """Eight bits, as the documentation says: exactly 256 volumes look like none."""
    base = drawn(gpu, stack(count), ZFAIL, (12, 9))[..., 0]
    assert (base > 0.5).all() if is_lit else not base.any()


@pytest.mark.parametrize("technique", [ZFAIL, ZPASS], ids=["zfail", "zpass"])
@pytest.mark.parametrize(("sheets", "visible"), [(0, 1.0), (1, 0.9), (2, 0.8), (7, 0.3), (12, 0.0)])
def test_darkening_by_the_count(gpu: Gpu, technique: ShadowVolume, sheets: int, visible: float) -> None:
    """0.1 a volume, seen from outside of all of them."""
    hanging = [props.quad((-1, y, 1), (1, y, 1), (1, y, -1), (-1, y, -1)) for y in np.linspace(1, 2, max(sheets, 1))]
    light = DirectionalLight((1, -1, 0), 3.0)
    scene = Scene([FLOOR, *hanging[:sheets]], [light], Camera((1.5, 0.5, 4), (1.5, 0, 0), fov=0.2))
    bare = drawn(gpu, scene.with_(instances=[FLOOR]), ZFAIL, (9, 9))[4, 4, 0]
    got = drawn(gpu, scene, replace(technique, darken_by_count=0.1), (9, 9))[4, 4, 0]
    assert got / bare == pytest.approx(visible, abs=0.004)


# --- beside outlines -----------------------------------------------------------------------------------------------


def test_leaves_with_holes_and_solids_shade_together(gpu: Gpu) -> None:
    """Visibility of a masked sheet, from a map, times that of a cube, from its volume."""
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[::2, :, 3] = 0
    texture = Texture(Image(pixels), filter="nearest")
    leaf = Material("leaf", (1, 1, 1, 1), alpha_mode="mask", base_color_texture=texture, double_sided=True)
    sheet = props.quad((-1.6, 1.6, 1), (0.1, 1.6, 1), (0.1, 1.6, -1), (-1.6, 1.6, -1), leaf)
    light = DirectionalLight((0.3, -1.0, -0.1), 3.0)
    scene = Scene([FLOOR, CUBE, sheet], [light], ABOVE)
    hit = props.cast(scene, ABOVE.position, props.rays(ABOVE, SIZE).directions)
    floor = hit.instance == 0
    bases = [drawn(gpu, scene.with_(instances=i), ZFAIL)[..., 0][floor] for i in (
        [FLOOR, CUBE, sheet], [FLOOR, CUBE], [FLOOR, sheet], [FLOOR])]  # fmt: skip
    both, solid, holed, bare = bases
    np.testing.assert_allclose(both * bare, solid * holed, atol=0.02 * bare.max() ** 2)
    assert ((solid == 0) & (holed > 0)).sum() > 20
    assert ((solid > 0) & (holed == 0)).sum() > 20
    assert share_as_rays(gpu, scene) > 0.98


def test_nothing_that_casts_and_no_light(gpu: Gpu) -> None:
    empty = Scene([], [SUN, POINT], ABOVE, background=(0.25, 0.5, 1.0))
    assert (drawn(gpu, empty, ZFAIL) == (0.25, 0.5, 1.0)).all()
    assert not drawn(gpu, Scene([FLOOR, CUBE], [], ABOVE), ZFAIL).any()
