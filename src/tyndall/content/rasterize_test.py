"""Depth drawn by compute passes: against the rasteriser's, against closed forms, and without gaps."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from numpy.typing import NDArray

from tyndall.content import rasterize as rasterizer
from tyndall.content.contract import Cull
from tyndall.content.mesh import Meshes
from tyndall.content.rasterize import DepthStack, rasterize
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.resources import Buffer
from tyndall.scene.model import Camera, Instance, Mesh, Scene

_LAYER = "package::techniques::shadow::depth_maps::ShadowLayer"
OWNER = "test"
NEAR = 1e-3
DOWN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # rows right, up, back of one who looks along −y


def orthographic(half: float, depth: float, rotation: NDArray[Any] = DOWN) -> NDArray[np.float64]:
    """A map of that half width around the origin, from ``depth`` before to ``depth`` behind it."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation / np.array([[half], [half], [2 * depth]])
    matrix[2, 3] = 0.5
    return matrix


def perspective(position: Sequence[float], rotation: NDArray[Any] = DOWN, tangent: float = 1.0) -> NDArray[np.float64]:
    view, projection = np.eye(4), np.zeros((4, 4))
    view[:3, :3], view[:3, 3] = rotation, -rotation @ np.asarray(position, float)
    projection[0, 0] = projection[1, 1] = 1 / tangent
    projection[2, 3], projection[3, 2] = NEAR, -1
    return projection @ view


def cube(position: Sequence[float]) -> list[NDArray[np.float64]]:
    found = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            back, helper = -sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            right = np.cross(helper, back)
            found.append(perspective(position, np.array([right, np.cross(back, right), back])))
    return found


class Maps:
    """The maps of a scene by both ways."""

    def __init__(self, gpu: Gpu, instances: Sequence[Instance], matrices: Sequence[NDArray[Any]], size: int) -> None:
        self.gpu, self.size, self.count = gpu, size, len(matrices)
        self.meshes = Meshes(gpu, Scene(instances, [], Camera()))
        rows = np.zeros(len(matrices), gpu.dtype(_LAYER))
        rows["view_proj"] = np.stack(matrices).transpose(0, 2, 1)
        self.table = gpu.buffer("layers", rows, owner=OWNER, element=_LAYER)
        self.made: dict[str, Buffer] = {}

    def __enter__(self) -> Maps:
        return self

    def __exit__(self, *_: object) -> None:
        for resource in (self.meshes, self.table, *self.made.values()):
            resource.close()
        self.gpu.forget_groups()

    def hardware(self, cull: Cull = "none") -> NDArray[np.float32]:
        gpu = self.gpu
        size = (self.size, self.size, self.count)
        found = []
        with gpu.texture("maps", size, "depth32float", owner=OWNER, dimension="2d-array", usage="target") as maps:
            for index in range(self.count):
                with gpu.render("maps", depth=(maps.view(layer=index), 0.0)) as native:
                    scope = {"shadow_layers": self.table.read(), "layer": gpu.constant(index)}
                    self.meshes.draw_depth(native, scope, cull)
            found = [gpu.read_texture(maps, layer=index)[..., 0] for index in range(self.count)]
        self.meshes.forget_bundles()
        return np.stack(found)

    def compute(self, cull: Cull = "none") -> NDArray[np.float32]:
        gpu = self.gpu
        words = self.buffer("words", DepthStack.bytes_of(self.size, self.count), "u32", "storage")
        stack = DepthStack(self.size, self.count, words)
        triangles = self.meshes.triangles()
        rasterize(gpu, "raster", [triangles] if triangles else [], self.table.read(), stack, cull, self.buffer)
        raw = gpu.read_buffer(words).view(np.float32).reshape(self.count, stack.stride)
        return raw[:, : self.size**2].reshape(self.count, self.size, self.size)

    def buffer(self, label: str, size: int, element: str, usage: str) -> Buffer:
        if label not in self.made:
            self.made[label] = self.gpu.buffer(label, size, owner=OWNER, element=element, usage=usage)
        return self.made[label]


def drawn(
    gpu: Gpu, instances: Sequence[Instance], matrices: Sequence[NDArray[Any]], size: int, cull: Cull = "none"
) -> NDArray[np.float32]:
    with Maps(gpu, instances, matrices, size) as maps:
        return maps.compute(cull)


def alike(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """The share of texels whose depths differ by no more than 1/256 texel's slope, where corners may be snapped."""
    edge = ((0, 0), (1, 1), (1, 1))
    padded = np.pad(other, edge, mode="edge").astype(float)
    middle = padded[:, 1:-1, 1:-1]
    shifts = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1)]
    around = [np.roll(padded, shift, (1, 2))[:, 1:-1, 1:-1] for shift in shifts]
    slope = np.max([np.abs(near - middle) for near in around], axis=0)
    close = np.abs(one - middle) <= slope / 256 + 1e-5 * middle
    return float((close & ((one > 0) == (other > 0))).mean())


def soup(seed: int, count: int, spread: float, largest: float) -> Instance:
    """Triangles of all sizes, from 1e-3 of the largest on, anywhere and any way round."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-spread, spread, (count, 1, 3))
    sizes = largest * 10 ** rng.uniform(-3, 0, (count, 1, 1))
    positions = (centres + sizes * rng.normal(size=(count, 3, 3))).reshape(-1, 3).astype(np.float32)
    return Instance(Mesh(positions, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3), material=props.WHITE))


def mirrored(instance: Instance, by: float = -1.0) -> Instance:
    return Instance(instance.mesh, ((by, 0, 0, 0.3), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))


MATRICES = {
    "directional": [orthographic(2.0, 20.0)],
    "spot": [perspective((0.2, 2.5, 0.1), tangent=0.8)],
    "point": cube((0.05, 0.1, -0.03)),
}


@pytest.mark.parametrize("light", MATRICES)
@pytest.mark.parametrize("size", [61, 160])
def test_maps_are_the_rasterisers(gpu: Gpu, light: str, size: int) -> None:
    """Triangles of all sizes, placed plainly, mirrored and double-sided; some cross the near plane and all sides."""
    sided = soup(3, 60, 1.5, 0.5)
    double = Instance(replace(sided.mesh, material=replace(props.WHITE, double_sided=True)))
    scene = [soup(1, 300, 2.0, 1.0), mirrored(soup(2, 100, 1.5, 0.7)), double]
    with Maps(gpu, scene, MATRICES[light], size) as maps:
        whole = maps.compute()
        assert (whole > 0).mean() > 0.1
        for cull in rasterizer.CULLS:
            ours, theirs = maps.compute(cull), maps.hardware(cull)
            assert alike(ours, theirs) > 0.999, cull
            assert ((ours > 0) == (theirs > 0)).mean() > 0.9995


@pytest.mark.parametrize("light", MATRICES)
def test_what_is_left_out_is_in_the_other_map(gpu: Gpu, light: str) -> None:
    scene = [soup(5, 200, 1.5, 0.6), mirrored(soup(6, 200, 1.5, 0.6))]
    with Maps(gpu, scene, MATRICES[light], 96) as maps:
        front, back, whole = (maps.compute(cull) for cull in ("front", "back", "none"))
    assert (np.maximum(front, back) == whole).all()
    assert ((front == whole) & (whole > 0)).mean() > 0.05
    assert ((back == whole) & (whole > 0)).mean() > 0.05


def lattice(lines_x: NDArray[Any], lines_z: NDArray[Any], seed: int = 0) -> Instance:
    """A level sheet at y = 0 of two triangles a cell, each cut by one of its diagonals."""
    x, z = np.meshgrid(lines_x, lines_z, indexing="ij")
    positions = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3).astype(np.float32)
    across, down = len(lines_x) - 1, len(lines_z) - 1
    first = (np.arange(across)[:, None] * (down + 1) + np.arange(down)).reshape(-1, 1)
    a, b, c, d = first, first + 1, first + down + 2, first + down + 1
    one, other = np.concatenate([a, b, c, a, c, d], 1), np.concatenate([a, b, d, b, c, d], 1)
    turned = np.random.default_rng(seed).random(len(first)) < 0.5
    return Instance(Mesh(positions, np.where(turned[:, None], one, other).reshape(-1, 3).astype(np.uint32)))


def graded(count: int, half: float, ratio: float) -> NDArray[np.float64]:
    """Lines from −half to half whose distances grow by a ratio each."""
    steps = np.cumsum(ratio ** np.arange(count))
    return np.concatenate([[-half], -half + 2 * half * steps / steps[-1]])


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize(
    ("lines", "half"),
    [
        pytest.param(graded(60, 3.0, 1.0), 2.0, id="even"),
        pytest.param(graded(40, 3.0, 1.35), 2.0, id="graded"),  # from a thousandth of a texel to most of the map
        pytest.param(graded(2, 3.0, 1.0), 2.0, id="large"),
        pytest.param(graded(24, 5000.0, 3.0), 2.0, id="huge"),
        pytest.param(graded(64, 2.25, 1.0), 2.25, id="on-centres"),
    ],
)
def test_a_sheet_of_any_triangles_has_no_hole(gpu: Gpu, lines: NDArray[Any], half: float, turn: float) -> None:
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    sheet = lattice(lines, lines[::-1])
    matrices = [
        orthographic(half if turn == 0 else half / 1.5, 2.0, DOWN @ rotation),
        perspective((0, 1.0, 0), DOWN @ rotation, half / 1.5),
        perspective((0.3, 1e-2, -0.2), DOWN @ rotation, 1.0),
    ]
    found = drawn(gpu, [sheet], matrices, 128)
    assert (found > 0).all()
    np.testing.assert_allclose(found[0], 0.5, rtol=1e-6)
    np.testing.assert_allclose(found[1], NEAR / 1.0, rtol=1e-5)
    np.testing.assert_allclose(found[2], NEAR / 1e-2, rtol=1e-4)


def test_a_room_around_a_point_light_is_closed(gpu: Gpu) -> None:
    """Its walls reach behind the light and past all sides of each map; depth is the distance along the face's axis."""
    position, size = np.array([0.7, 1.9, -1.1]), 150
    low, high = np.array([-3.0, 0.0, -4.0]), np.array([3.0, 2.5, 2.0])
    found = drawn(gpu, [props.box(tuple(low), tuple(high))], cube(position), size)
    ndc = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(ndc, -ndc)
    for depth, matrix in zip(found, cube(position), strict=True):
        right, up, forward = matrix[0, :3], matrix[1, :3], matrix[3, :3]
        ways = x[..., None] * right + y[..., None] * up + forward
        with np.errstate(divide="ignore"):
            reach = np.where(ways > 0, (high - position) / ways, (low - position) / ways)
        exact = NEAR / np.min(np.where(ways == 0, np.inf, reach), axis=-1)
        # Corners may be snapped by half of 1/256 texel, which moves a wall's depth by as much of its slope.
        slope = np.max(np.abs(np.gradient(exact)), axis=0)
        near_edges = np.abs(depth - exact) > slope / 200 + 1e-5 * exact
        assert near_edges.mean() < 1e-3
        assert (depth > 0).all()


@pytest.mark.parametrize("distance", [1.0, 1e-3 * 1.0001, 1e-3 * 0.9999, 1e-3 * 0.5, -1.0])
def test_what_is_before_the_near_plane_is_cut_off(gpu: Gpu, distance: float) -> None:
    square = props.quad((-9, -distance, 9), (9, -distance, 9), (9, -distance, -9), (-9, -distance, -9))
    (found,) = drawn(gpu, [square], [perspective((0, 0, 0))], 70)
    if distance > NEAR:
        np.testing.assert_allclose(found, NEAR / distance, rtol=1e-5)
    else:
        assert (found == 0).all()


def test_an_orthographic_map_begins_at_its_near_plane(gpu: Gpu) -> None:
    """A ramp through both ends of the map's depth: nothing before the one or behind the other."""
    size = 80
    ramp = props.quad((-2, -2, 1), (2, -2, 1), (2, 2, -1), (-2, 2, -1))  # up the map it comes nearer
    (found,) = drawn(gpu, [ramp], [orthographic(1.0, 1.0)], size)
    up = np.linspace(1, -1, 2 * size + 1)[1::2]
    expected = np.where(np.abs(up) < 0.5, 0.5 + up, 0)
    np.testing.assert_allclose(found, np.broadcast_to(expected[:, None], found.shape), atol=1e-4)


def test_half_a_slope_is_before_the_near_plane(gpu: Gpu) -> None:
    """A ramp from in front of the light to behind it: as the closed form, and nothing beyond the near plane."""
    ramp = props.quad((-50, -4, -1), (50, -4, -1), (50, 4, 1.5), (-50, 4, 1.5))  # y = 3.2·z − 0.8
    size = 96
    (found,) = drawn(gpu, [ramp], [perspective((0, 0, 0))], size)
    z = np.linspace(1, -1, 2 * size + 1)[1::2]  # up the map is −z
    down = 0.8 / (1 + 3.2 * -z)  # of the ray (x, −1, −z·) t where it meets the ramp
    seen = (down > NEAR) & (down <= 4)
    assert 10 < seen.sum() < size
    column = found[:, size // 2]
    np.testing.assert_allclose(column[seen], NEAR / down[seen], rtol=1e-3)
    assert (column[~seen] == 0).all()


@pytest.mark.parametrize("count", [1, 255, 256, 257, 1000])
def test_every_triangle_of_any_number_is_drawn(gpu: Gpu, count: int) -> None:
    """A triangle around a texel's centre each, in several placements."""
    size = 48
    place = np.random.default_rng(count).permutation(size * size)[:count]
    centres = (np.stack([place % size, place // size], axis=1) + 0.5) / size * 2 - 1
    shape = np.array([[-0.4, -0.3], [0.4, -0.3], [0.0, 0.45]]) / size * 2
    corners = (centres[:, None] + shape).reshape(-1, 2)
    positions = np.stack([corners[:, 0], np.zeros(3 * count), corners[:, 1]], axis=1).astype(np.float32)
    indices = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    cuts = sorted({0, count // 3, count // 2, count})
    parts = [Instance(Mesh(positions, indices[a:b])) for a, b in itertools.pairwise(cuts)]
    (found,) = drawn(gpu, parts, [orthographic(1.0, 1.0)], size)
    expected = np.zeros(size * size, bool)
    expected[place] = True
    assert ((found > 0).ravel() == expected).all()


def test_maps_in_turns_are_the_same(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = [soup(7, 150, 1.5, 0.6)]
    at_once = drawn(gpu, scene, MATRICES["point"], 50)
    monkeypatch.setattr(rasterizer, "_ITEM_BYTES", 8 * 150 * 4)
    assert (drawn(gpu, scene, MATRICES["point"], 50) == at_once).all()
    assert (at_once > 0).mean() > 0.1


@pytest.mark.parametrize("room", [0, 20, 1000])
def test_without_room_for_more_workgroups_large_triangles_are_drawn_by_one(
    gpu: Gpu, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    scene = [soup(8, 40, 1.0, 3.0)]
    freely = drawn(gpu, scene, MATRICES["directional"], 300)
    monkeypatch.setattr(rasterizer, "_EXTRA", room)
    assert (drawn(gpu, scene, MATRICES["directional"], 300) == freely).all()
    assert (freely > 0).mean() > 0.5


@pytest.mark.parametrize("width", [1.0, 0.2, 0.01])
def test_what_is_thinner_than_a_texel_shows_where_it_meets_centres(gpu: Gpu, width: float) -> None:
    """A level bar of some texels' width: as many texels as centres that it holds."""
    size = 64
    texel = 2 / size
    z = 0.3 * texel + np.arange(-20, 20, 7) * texel * 1.03
    bars = [props.quad((-2, 0, a + width * texel), (2, 0, a + width * texel), (2, 0, a), (-2, 0, a)) for a in z]
    (found,) = drawn(gpu, bars, [orthographic(1.0, 1.0)], size)
    centres = (np.arange(size) + 0.5) / size * 2 - 1
    held = ((centres[:, None] > z) & (centres[:, None] < z + width * texel)).any(axis=1)
    assert ((found > 0) == held[:, None]).all()


def test_edges_on_centres_belong_to_the_upper_left(gpu: Gpu) -> None:
    """A square from one texel's centre to another's holds the first row and column, and not the last ones."""
    size = 32
    low, high = (5.5 / size * 2 - 1), (21.5 / size * 2 - 1)
    square = props.quad((low, 0, high), (high, 0, high), (high, 0, low), (low, 0, low))
    expected = np.zeros((size, size), bool)
    expected[5:21, 5:21] = True
    for instance in (square, Instance(square.mesh, ((0, 0, 1, 0), (0, -1, 0, 0), (1, 0, 0, 0), (0, 0, 0, 1)))):
        (found,) = drawn(gpu, [instance], [orthographic(1.0, 1.0)], size)
        assert ((found > 0) == expected).all()


def test_triangles_without_area_are_not_drawn(gpu: Gpu) -> None:
    positions = np.array([[-1, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 1], [0, 1, 0]], np.float32)
    flat = Mesh(positions, np.array([[0, 1, 2], [0, 0, 1], [3, 3, 3], [2, 4, 2], [0, 1, 4]], np.uint32))
    found = drawn(gpu, [Instance(flat)], [orthographic(1.03, 2.0), *cube((0, 0, 0))], 64)
    assert (found[0] == 0).all(), "the last one stands on edge"


def test_numbers_that_are_not_finite_on_a_map_do_no_harm(gpu: Gpu) -> None:
    """Corners so far away that the map's clip space overflows; their neighbours are drawn."""
    far = 1e18
    corners = np.array([[far, 0, far], [-far, far, 1], [1, -far, far]], np.float32)
    wild = Instance(Mesh(corners, np.array([[0, 1, 2]])), tuple(tuple(row) for row in np.diag([1e22, 1e22, 1e22, 1])))
    plain = props.floor(0, 0.5)
    (found,) = drawn(gpu, [wild, plain], [orthographic(1.0, 1.0)], 64)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[20:44, 20:44], 0.5, rtol=1e-5)


def test_nothing_to_draw_leaves_the_maps_empty(gpu: Gpu) -> None:
    assert (drawn(gpu, [], MATRICES["point"], 32) == 0).all()
    assert (drawn(gpu, [props.floor(0, 2)], [perspective((0, -1.0, 0))], 32) == 0).all()


def test_a_map_beyond_the_adapters_buffers_is_refused(gpu: Gpu) -> None:
    with Maps(gpu, [props.floor(0, 2)], [orthographic(1.0, 1.0)], 32) as maps:
        triangles = maps.meshes.triangles()
        assert triangles is not None
        words = maps.buffer("words", 16, "u32", "storage")
        huge = int(math.sqrt(gpu.limits["max-storage-buffer-binding-size"] / 4)) + 64
        with pytest.raises(GpuError, match="more than this adapter's buffers hold"):
            rasterize(gpu, "raster", [triangles], maps.table.read(), DepthStack(huge, 1, words), "none", maps.buffer)
