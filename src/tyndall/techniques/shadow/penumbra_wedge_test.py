"""Penumbra wedges: closed forms of straight edges and corners, and lights of many points."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from props import WHITE, shoot

from tyndall.gpu.device import Gpu
from tyndall.scene.bundled import primitives
from tyndall.scene.model import Camera, DirectionalLight, Instance, Light, PointLight, RectLight, Scene
from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.penumbra_wedge import PenumbraWedge
from tyndall.techniques.shadow.shadow_volume import ShadowVolume

SIZE = (96, 72)
WEDGE = PenumbraWedge()
TWO_SIDED = replace(WHITE, double_sided=True)
FLOOR = props.floor(0, 4)
CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
DOWN = Camera((0, 2.0, 0), (0, 0, 0), (0, 0, -1), fov=0.7, near=0.05)  # below the height of what casts
HEIGHT = 2.5  # of what casts over the floor


def drawn(gpu: Gpu, scene: Scene, technique: Technique = WEDGE, size: tuple[int, int] = SIZE) -> np.ndarray:
    base = shoot(gpu, scene, size, shadow=technique).base[..., 0]
    assert np.isfinite(base).all()
    return base


def on_floor(gpu: Gpu, scene: Scene, technique: Technique = WEDGE) -> tuple[np.ndarray, np.ndarray]:
    """(visibility, points (H, W, 3)) of the floor, which is the first shape, over that of the floor alone."""
    seen = props.rays(scene.camera, SIZE)
    points = seen.at(props.cast(scene, seen.origin, seen.directions).distance)
    assert np.abs(points[..., 1]).max() < 1e-6
    bare = drawn(gpu, scene.with_(instances=scene.instances[:1]))
    return drawn(gpu, scene, technique) / bare, points


def half_plane(material: Any = WHITE) -> Instance:
    """Everything at x > 0 above the floor; faces up."""
    h, far = HEIGHT, 60.0
    return props.quad((0, h, far), (far, h, far), (far, h, -far), (0, h, -far), material)


def quarter_plane() -> Instance:
    """Everything at x > 0 and z > 0."""
    h, far = HEIGHT, 60.0
    return props.quad((0, h, far), (far, h, far), (far, h, 0), (0, h, 0))


def disk_beside(t: np.ndarray) -> np.ndarray:
    """The share of the unit disk that lies at x < −t: what a straight edge leaves of it, for t of −1 … 1."""
    t = np.clip(t, -1, 1)
    return (np.arccos(t) - t * np.sqrt(1 - t * t)) / np.pi


# --- closed forms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.05, 0.2])
@pytest.mark.parametrize("material", [WHITE, TWO_SIDED], ids=["one-sided", "two-sided"])
def test_a_straight_edge_under_the_sun(gpu: Gpu, angle: float, material: Any) -> None:
    """V = (acos t − t·√(1 − t²))/π, with t the edge's distance from the centre in radii, negative where it is lit."""
    scene = Scene([FLOOR, half_plane(material)], [DirectionalLight((0, -1, 0), 3.0, angular_diameter=angle)], DOWN)
    visible, points = on_floor(gpu, scene)
    t = points[..., 0] / (HEIGHT * math.tan(angle / 2))
    within = np.abs(t) < 1
    assert within.sum() > 100
    np.testing.assert_allclose(visible[within], disk_beside(t[within]), atol=0.006)
    assert (visible[t > 1.02] == 0).all(), "the umbra is dark"
    assert (visible[t < -1.02] == 1).all(), "outside of the penumbra all light arrives"
    assert (t > 1.02).sum() > 100
    assert (t < -1.02).sum() > 100


def test_a_straight_edge_under_a_sphere(gpu: Gpu) -> None:
    """The half plane of a point and the edge cuts the disk that the sphere is seen as, at the sine of its angle."""
    light = PointLight((0, 5, 0), 20.0, radius=0.3)
    visible, points = on_floor(gpu, Scene([FLOOR, half_plane()], [light], DOWN))
    way = np.array(light.position) - points
    edge = np.stack([-points[..., 0], np.full(SIZE[::-1], HEIGHT), np.zeros(SIZE[::-1])], -1)
    normal = np.cross(edge, (0, 0, 1.0))  # of the plane through the point and the edge
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    offset = (way * normal).sum(-1)  # of the light's centre from it
    distance = np.linalg.norm(way, axis=-1)
    # The cone of tangents meets the plane through the centre, across the way, in a disk of this radius.
    radius = distance * np.tan(np.arcsin(light.radius / distance))
    across = normal - (normal * way).sum(-1, keepdims=True) * way / distance[..., None] ** 2
    offset = offset / np.linalg.norm(across, axis=-1)
    t = np.where(points[..., 0] >= 0, 1, -1) * np.abs(offset) / radius
    within = np.abs(t) < 1
    assert within.sum() > 300
    np.testing.assert_allclose(visible[within], disk_beside(t[within]), atol=0.006)
    assert (visible[t > 1.02] == 0).all()
    assert (visible[t < -1.02] == 1).all()


@pytest.mark.parametrize("rotation", [0.0, math.pi / 2, 0.4, 0.9])
def test_a_straight_edge_under_a_rectangle(gpu: Gpu, rotation: float) -> None:
    """A linear ramp where the sides are parallel to the edge; else the clipped rectangle's area, from its corners."""
    light = RectLight((0, 5, 0), (0, -1, 0), 20.0, width=0.8, height=0.5, rotation=rotation)
    visible, points = on_floor(gpu, Scene([FLOOR, half_plane()], [light], DOWN))
    edge = points[..., 0] * (
        1 - 5 / HEIGHT
    )  # where the edge is seen in the light's plane; the light is open at x < edge
    across, along = light.axes
    # A uniform rectangle projected onto x is the sum of two uniform variables: a trapezium of these half widths.
    wide, narrow = sorted((abs(across[0]), abs(along[0])), reverse=True)
    x = np.linspace(-2, 2, 4001)
    density = np.convolve(1.0 * (np.abs(x) <= wide), 1.0 * (np.abs(x) <= max(narrow, 1e-4)), "same")
    open_share = np.interp(edge, x, np.cumsum(density) / density.sum())
    within = np.abs(edge) < wide + narrow
    assert within.sum() > 300
    np.testing.assert_allclose(visible[within], open_share[within], atol=0.006)
    far = wide + narrow + 0.02
    assert (visible[edge > far] == 1).all()
    assert (visible[edge < -far] == 0).all()
    if min(abs(across[0]), abs(along[0])) < 1e-6:  # parallel: exactly a line
        np.testing.assert_allclose(visible[within], 0.5 + 0.5 * edge[within] / wide, atol=0.006)


def test_the_corner_of_a_sheet_hides_the_product_of_two_edges(gpu: Gpu) -> None:
    """Under a rectangle whose sides are parallel to the corner's; a quarter exactly beneath it."""
    light = RectLight((0, 5, 0), (0, -1, 0), 20.0, width=0.8, height=0.8)
    visible, points = on_floor(gpu, Scene([FLOOR, quarter_plane()], [light], DOWN))
    edge = points[..., [0, 2]] * (1 - 5 / HEIGHT) / 0.4
    hidden = np.clip(0.5 - 0.5 * edge, 0, 1)
    within = (np.abs(edge) < 1).all(-1)
    assert within.sum() > 300
    np.testing.assert_allclose(visible, 1 - hidden.prod(-1), atol=0.006)
    nearest = np.unravel_index(np.abs(points[..., [0, 2]]).sum(-1).argmin(), within.shape)
    assert visible[nearest] == pytest.approx(0.75, abs=0.03)


# --- against lights of many points ---------------------------------------------------------------------------------


def points_of(light: Light, count: int) -> list[Light]:
    """Lights without a size, spread over what a light shows towards the origin."""
    u = (np.arange(count) + 0.5) / count
    v = (np.arange(count) * 0.6180339887498949) % 1
    if isinstance(light, RectLight):
        across, along = light.axes
        ways = (2 * u - 1)[:, None] * across + (2 * v - 1)[:, None] * along
        return [PointLight(tuple(np.array(light.position) + way), light.intensity) for way in ways]
    disk = np.sqrt(u)[:, None] * np.stack([np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)], 1)
    travels = np.array(light.direction if isinstance(light, DirectionalLight) else light.position, float)
    travels *= (1 if isinstance(light, DirectionalLight) else -1) / np.linalg.norm(travels)
    x = np.cross(travels, (0.3, 0.1, 0.9))
    x /= np.linalg.norm(x)
    ways = light.extent * (disk[:, :1] * x + disk[:, 1:] * np.cross(travels, x))
    if isinstance(light, DirectionalLight):
        return [replace(light, direction=tuple(travels + way), angular_diameter=0.0) for way in ways]
    assert isinstance(light, PointLight)
    return [replace(light, position=tuple(np.array(light.position) + way), radius=0.0) for way in ways]


LIGHTS = [
    pytest.param(PointLight((-1.2, 3.2, 0.9), 20.0, radius=0.3), id="point"),
    pytest.param(DirectionalLight((0.5, -1.0, -0.35), 3.0, angular_diameter=0.2), id="directional"),
    pytest.param(RectLight((-1.2, 3.2, 0.9), (0.5, -1, -0.3), 20.0, width=0.7, height=0.4, rotation=0.5), id="rect"),
]
BALL = Instance(primitives.ball(0.7, 16, 8).at(0, 0.7, 0).mesh(WHITE, "ball"))
BAR = props.box((-1.2, 1.8, -0.1), (1.2, 2.0, 0.1))


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(
    ("instances", "most"), [([FLOOR, CUBE], 0.025), ([FLOOR, BALL, BAR], 0.06)], ids=["cube", "bar over ball"]
)
def test_penumbrae_are_those_of_many_points(gpu: Gpu, instances: list[Instance], most: float, light: Light) -> None:
    """The root mean square error of visibility where there is a penumbra, on a plane and on a curved receiver."""
    size = (48, 36)
    scene = Scene(instances, [light], replace(ABOVE, fov=0.6))
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    onto = np.isfinite(hit.distance)
    points = seen.at(np.where(onto, hit.distance, 1)) + 1e-3 * hit.normal
    truth = np.mean([props.lit(scene, part, points) for part in points_of(light, 48)], axis=0)
    full = drawn(gpu, scene, ShadowVolume(darken_by_count=1e-6), size)
    visible = drawn(gpu, scene, WEDGE, size) / np.where(full > 0, full, 1)
    _, travels = props.arriving(light, 0.0, points)
    sure = onto & (full > 0.05 * full.max()) & (-(travels * hit.normal).sum(-1) > 0.2)
    soft = sure & (truth > 0.02) & (truth < 0.98)
    assert soft.sum() > 40
    hard = drawn(gpu, scene, ShadowVolume(), size) / np.where(full > 0, full, 1)
    error = math.sqrt(np.mean((visible - truth)[soft] ** 2))
    assert error < most
    assert error < 0.2 * math.sqrt(np.mean((hard - truth)[soft] ** 2))
    assert math.sqrt(np.mean((visible - truth)[sure] ** 2)) < most


@pytest.mark.parametrize(
    "kinds",
    [
        lambda size: PointLight((-1.2, 2.2, 0.9), 20.0, radius=size),
        lambda size: DirectionalLight((0.5, -1.0, -0.35), 3.0, angular_diameter=size),
        lambda size: RectLight((-1.2, 2.2, 0.9), (0.5, -1, -0.3), 20.0, width=max(size, 1e-6), height=max(size, 1e-6)),
    ],
    ids=["point", "directional", "rect"],
)
def test_it_tends_to_the_hard_shadow_as_the_light_shrinks(gpu: Gpu, kinds: Any) -> None:
    errors = []
    for size in (0.3, 0.1, 0.03, 0.01, 0.0):
        scene = Scene([FLOOR, CUBE], [kinds(size)], ABOVE)
        hard = drawn(gpu, scene, ShadowVolume())
        errors.append(float(np.sqrt(np.mean((drawn(gpu, scene) - hard) ** 2)) / hard.mean()))
    assert errors[0] > 0.02
    assert all(a > b for a, b in itertools.pairwise(errors)), errors
    assert errors[3] < 0.3 * errors[0]
    assert errors[4] <= (0.01 if isinstance(kinds(0.0), RectLight) else 0.0)


# --- what must not happen ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("light", LIGHTS)
def test_what_nothing_hides_is_lit_in_full(gpu: Gpu, light: Light) -> None:
    """Not a bit less than without anything that casts; the floor itself casts."""
    scene = Scene([FLOOR, props.box((-4, -2, -4), (4, -1, 4))], [light], ABOVE)
    np.testing.assert_array_equal(drawn(gpu, scene), drawn(gpu, scene, ShadowVolume(darken_by_count=1e-6)))


def test_a_light_larger_than_what_it_shines_on_leaves_no_umbra(gpu: Gpu) -> None:
    """A small sheet high above: its whole outline stands before the light, and hides what it covers of it."""
    small = props.quad((-0.1, 1.2, 0.1), (0.1, 1.2, 0.1), (0.1, 1.2, -0.1), (-0.1, 1.2, -0.1))
    light = RectLight((0, 3, 0), (0, -1, 0), 20.0, width=1.5, height=1.5)
    visible, points = on_floor(gpu, Scene([FLOOR, small], [light], replace(DOWN, position=(0, 1.15, 0))))
    # From just beneath, the sheet is seen as a square of 0.2·3/1.2 before the light.
    beneath = np.unravel_index(np.abs(points[..., [0, 2]]).sum(-1).argmin(), visible.shape)
    assert visible[beneath] == pytest.approx(1 - (0.2 * 3 / 1.2) ** 2 / 1.5**2, abs=0.005)
    assert visible.min() > 0.85
    assert (visible < 0.99).mean() > 0.1


@pytest.mark.parametrize("light", LIGHTS)
def test_triangles_that_lie_on_one_another_hide_once(gpu: Gpu, light: Light) -> None:
    """A sheet, the same sheet facing away, and one with both its sides as a closed body without thickness."""
    sheet = props.quad((-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1), TWO_SIDED)
    mesh = sheet.mesh
    assert mesh.normals is not None
    back = Instance(replace(mesh, indices=mesh.indices[:, ::-1]))
    body = Instance(replace(mesh, indices=np.concatenate([mesh.indices, mesh.indices[:, ::-1]])))
    one, other, both = (drawn(gpu, Scene([FLOOR, shape], [light], ABOVE)) for shape in (sheet, back, body))
    scene = Scene([FLOOR, sheet], [light], ABOVE)
    floor = props.cast(scene, ABOVE.position, props.rays(ABOVE, SIZE).directions).instance == 0
    for drawing in (other, both):
        assert (np.abs(drawing - one) > 0.01 * one.max())[floor].mean() < 0.002
    bare = drawn(gpu, Scene([FLOOR], [light], ABOVE))
    assert ((one > 0.1 * bare) & (one < 0.9 * bare)).sum() > 100


@pytest.mark.parametrize("light", LIGHTS)
def test_no_pixel_stands_out(gpu: Gpu, light: Light) -> None:
    """Count and edges never disagree by the whole light: no pixel differs from the median around it by half of it."""
    size = (160, 120)
    slab = props.box((-1, 0.8, -0.7), (1, 1.0, 0.7))
    scene = Scene([FLOOR, slab], [light], replace(ABOVE, position=(0.3, 0.7, 3.5), target=(0.3, 0, 0)))
    base = drawn(gpu, scene, WEDGE, size)
    hit = props.cast(scene, scene.camera.position, props.rays(scene.camera, size).directions)
    around = sliding_window_view(np.pad(hit.instance, 1, mode="edge"), (3, 3))
    inner = (around == 0).all(axis=(2, 3))
    bare = drawn(gpu, scene.with_(instances=[FLOOR]), WEDGE, size)
    visible = np.where(bare > 0, base / np.where(bare > 0, bare, 1), 1)
    median = np.median(sliding_window_view(np.pad(visible, 1, mode="edge"), (3, 3)), axis=(2, 3))
    assert ((visible > 0.1) & (visible < 0.9) & inner).sum() > 200
    assert np.abs(visible - median)[inner].max() < 0.5
    assert visible[inner].min() >= 0
    assert visible[inner].max() <= 1.001


@pytest.mark.parametrize(
    ("instances", "light"),
    [
        pytest.param([FLOOR, CUBE], PointLight((0, 0.9, 0), 5.0, radius=0.2), id="inside of a box"),
        pytest.param([FLOOR, CUBE], PointLight((0.1, 1.4, 0.1), 5.0, radius=0.3), id="cut by a side"),
        pytest.param([FLOOR, CUBE], PointLight((0.5, 1.4, 0.5), 5.0, radius=0.3), id="at a vertex"),
        pytest.param([FLOOR, CUBE], PointLight((1, 0, 1), 5.0, radius=0.3), id="cut by the floor"),
        pytest.param([FLOOR, CUBE], PointLight((2, 3.5, 4), 5.0, radius=3.0), id="around the camera"),
        pytest.param([FLOOR, CUBE], PointLight((4e5, 9e5, 1e5), 1e13, radius=1e5), id="far away"),
        pytest.param([FLOOR, CUBE], DirectionalLight((0, -1, 0), angular_diameter=3.0), id="all of the sky"),
        pytest.param([FLOOR, CUBE], RectLight((0, 1.4, 0), (0, -1, 0), 5.0), id="a rectangle in a side"),
        pytest.param([FLOOR, CUBE], RectLight((0, 3, 0), (0, -1, 0), 5.0, width=100, height=1e-6), id="a line"),
    ],
)
def test_a_light_anywhere_draws_no_garbage(gpu: Gpu, instances: list[Instance], light: Light) -> None:
    """Never more light than without a shadow, and none where the whole of it is hidden."""
    scene = Scene(instances, [light], ABOVE)
    got, most = drawn(gpu, scene), drawn(gpu, scene, ShadowVolume(darken_by_count=1e-6))
    assert got.min() >= 0
    assert (got <= most * 1.002 + 1e-6).all()
    if light.kind == "point" and light.position == (0, 0.9, 0):
        assert not got.any()
