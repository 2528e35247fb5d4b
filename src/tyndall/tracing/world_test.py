"""Rays hit what a brute-force caster on the CPU hits, wherever and however it is placed; and the tree is a tree."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import props
import pytest
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.scene import bundled
from tyndall.scene.model import Camera, Image, Instance, Mat4, Material, Mesh, Scene, Texture
from tyndall.tracing.bvh import STACK
from tyndall.tracing.cast import blocked, cast, pack_rays
from tyndall.tracing.world import World

FAR = 1e9
CAST_RAY = "package::tracing::cast::CastRay"


def placed(
    move: tuple[float, float, float] = (0, 0, 0),
    scale: tuple[float, float, float] = (1, 1, 1),
    turn: float = 0.0,
) -> Mat4:
    """Scaled, turned round a slanting axis, and moved."""
    axis = np.array([0.6, 0.0, 0.8])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) + math.sin(turn) * cross + (1 - math.cos(turn)) * cross @ cross) @ np.diag(scale)
    matrix[:3, 3] = move
    return tuple(tuple(float(x) for x in row) for row in matrix)  # type: ignore[return-value]


def blob(count: int = 60, seed: int = 0, material: Material = props.WHITE, uvs: bool = False) -> Mesh:
    """Triangles of very different sizes strewn about the unit cube."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-2, -0.3, (count, 1, 1))
    corners = rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    return Mesh(
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(3 * count, dtype=np.uint32).reshape(-1, 3),
        uvs=rng.uniform(0, 1, (3 * count, 2)).astype(np.float32) if uvs else None,
        material=material,
    )


def random_rays(count: int, seed: int = 1, reach: float = 4.0) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-reach, reach, (count, 3)).astype(np.float32)
    towards = rng.uniform(-1.5, 1.5, (count, 3)).astype(np.float32)
    return origins, ((towards - origins) * rng.uniform(0.3, 3, (count, 1))).astype(np.float32)


def agree(gpu: Gpu, scene: Scene, count: int = 600, reach: float = 4.0, movable: bool = False) -> NDArray[np.bool_]:
    """Check all that a ray can be asked against the brute-force caster; returns which rays the device says to hit."""
    origins, ways = random_rays(count, reach=reach)
    truth = props.cast(scene, origins, ways)
    there = np.isfinite(truth.distance)
    with World(gpu, scene, movable=movable) as world:
        assert world.depth < STACK
        hits = cast(gpu, world, origins, ways)
        answers = blocked(gpu, world, origins, ways)
        short = blocked(gpu, world, origins[there], ways[there], far=truth.distance[there] * 0.999)
    found: NDArray[np.bool_] = hits["t"] < FAR
    same = found == there
    assert same.mean() > 0.998  # a ray through an edge may fall on either side
    both = same & there
    np.testing.assert_allclose(hits["t"][both], truth.distance[both], rtol=2e-4, atol=2e-5)
    assert (hits["instance"][both] == truth.instance[both]).mean() > 0.99  # some surfaces lie in each other
    assert (answers == found).all()
    assert not short.any()
    return found


@pytest.mark.parametrize(
    "instances",
    [
        pytest.param(lambda: [Instance(blob())], id="one"),
        pytest.param(
            lambda: [Instance(blob()), Instance(blob(seed=2), placed((0.5, 0, 0.3), (0.5, 2, 1), 0.7))], id="two"
        ),
        pytest.param(
            lambda: [Instance(mesh, placed((x, 0, 0), (0.4, 0.5, 0.3), x)) for mesh in [blob()] for x in (-1, 0, 1)],
            id="shared",
        ),
        pytest.param(
            lambda: [
                *(Instance(mesh, placed((x, 0.1, 0), (-0.4, 0.5, 0.6), x)) for mesh in [blob()] for x in (-1, 1)),
                Instance(blob(seed=3), placed(scale=(1, -1, 1))),
            ],
            id="mirrored",
        ),
        pytest.param(
            lambda: [
                *(Instance(mesh, placed(scale=(1, 1, 0), turn=x)) for mesh in [blob()] for x in (0.2, 0.9)),
                Instance(blob(seed=3), placed(scale=(0, 1, 1))),
            ],
            id="flat",
        ),
        pytest.param(lambda: [Instance(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))], id="one triangle"),
    ],
)
@pytest.mark.parametrize("movable", [False, True])
def test_rays_hit_what_is_there(gpu: Gpu, instances: Callable[[], list[Instance]], movable: bool) -> None:
    assert agree(gpu, Scene(instances()), movable=movable).any()


def test_a_bundled_scene(gpu: Gpu) -> None:
    scene = bundled.box()
    assert agree(gpu, scene, 300, reach=2.0).mean() > 0.8


def test_nothing_is_hit_in_an_empty_scene(gpu: Gpu) -> None:
    origins, ways = random_rays(10)
    with World(gpu, Scene()) as world:
        assert (cast(gpu, world, origins, ways)["t"] == np.float32(FAR)).all()
        assert not blocked(gpu, world, origins, ways).any()


def test_buffers_in_parts(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tree and its vertices are split where a binding ends, and rays do not notice."""
    mesh = blob(400)
    scene = Scene([Instance(mesh, placed((x, 0, 0), (0.6, 0.6, 0.6), x)) for x in (-1, 1)] + [Instance(blob(300, 5))])
    whole = agree(gpu, scene)
    monkeypatch.setattr(gpu, "part_bytes", 8192)
    with World(gpu, scene) as world:
        assert len(world.bindings["trace_nodes"].bounds) > 3
        assert len(world.bindings["trace_triangles"].bounds) > 3
    assert (agree(gpu, scene) == whole).all()


def test_holes_let_light_through(gpu: Gpu) -> None:
    rng = np.random.default_rng(3)
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[..., 3] = 255 * rng.integers(0, 2, (8, 8))
    leaf = Material(
        base_color_texture=Texture(Image(pixels), filter="nearest"),
        alpha_mode="mask",
        alpha_cutoff=0.5,
        double_sided=True,
    )
    scene = Scene([Instance(blob(80, material=leaf, uvs=True))])
    with_holes = agree(gpu, scene, 1500)
    solid = agree(gpu, Scene([Instance(blob(80, uvs=True))]), 1500)
    assert with_holes.sum() < solid.sum()


def test_back_faces_are_culled_as_in_the_g_buffer(gpu: Gpu) -> None:
    """Of a single-sided quad seen from both sides, turned, mirrored, shared or not."""
    quad = props.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)).mesh
    double = props.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), Material(double_sided=True)).mesh
    for mesh, sides in ((quad, 1), (double, 2)):
        for mirror in (1, -1):
            for copies in (1, 2):
                scene = Scene([Instance(mesh, placed((0, 0, 9 * i), (mirror, 1, 1))) for i in range(copies)])
                with World(gpu, scene) as world:
                    front = cast(gpu, world, [[0.1, 0.2, 3]], [[0, 0, -1]], far=5.0, cull=True)["t"][0] < FAR
                    back = cast(gpu, world, [[0.1, 0.2, -3]], [[0, 0, 1]], far=5.0, cull=True)["t"][0] < FAR
                    either = cast(gpu, world, [[0.1, 0.2, -3]], [[0, 0, 1]], far=5.0)["t"][0] < FAR
                assert (front, back, either) == (True, sides == 2, True)


def test_no_ray_slips_between_triangles(gpu: Gpu) -> None:
    """From inside a closed mesh, rays at its very edges and vertices always hit."""
    mesh = bundled.box().instances[-1].mesh
    steps = np.linspace(-1, 1, 33)
    x, y = np.meshgrid(steps, steps)
    grid = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    grid /= np.linalg.norm(grid, axis=1, keepdims=True)
    faces = np.concatenate(
        [grid @ _turn(axis, quarter) for axis, quarter in ((0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 3))]
    )
    quads = [
        [a, a + 1, a + 34, a + 33]
        for f in range(6)
        for r in range(32)
        for a in range(f * 1089 + r * 33, f * 1089 + r * 33 + 32)
    ]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    sphere = Mesh((7 * faces).astype(np.float32), np.array(triangles, np.uint32))
    edges = np.concatenate([sphere.positions[sphere.indices], sphere.positions[np.roll(sphere.indices, 1, axis=1)]])
    rng = np.random.default_rng(5)
    a, b = sphere.positions[sphere.indices[:, 0]], sphere.positions[sphere.indices[:, 1]]
    targets = np.concatenate([edges.reshape(-1, 3), a + rng.uniform(0, 1, (len(a), 1)).astype(np.float32) * (b - a)])
    origin = np.array([0.3, -0.2, 0.1], np.float32)
    with World(gpu, Scene([Instance(sphere), *(Instance(mesh, placed((50, 0, 0))),)])) as world:
        assert blocked(gpu, world, np.broadcast_to(origin, targets.shape), targets - origin).all()


def tube(length: float, radius: float, sides: int) -> Mesh:
    """A closed prism along z whose sides and ends are long, thin triangles."""
    angle = np.arange(sides) * (2 * math.pi / sides)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(sides)], axis=1)
    ends = np.array([[0, 0, length / 2]])
    a = np.arange(sides)
    b = (a + 1) % sides
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    return Mesh(
        np.concatenate([ring - ends, ring + ends, -ends, ends]).astype(np.float32),
        np.concatenate(
            [
                np.stack(t, 1)
                for t in ((a, b, b + sides), (a, b + sides, a + sides), (b, a, low), (a + sides, b + sides, high))
            ]
        ),
    )


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("copies", [1, 2])
def test_long_thin_triangles_are_hit_where_they_are(gpu: Gpu, scale: float, copies: int) -> None:
    """From inside a tube of a thousand sides that lies askew, each 60000 times as long as wide: no ray escapes, and
    each ends at the first of the planes that it meets.
    """
    mesh = tube(1000 * scale, 2.5 * scale, 1000)
    way = np.asarray(placed(turn=0.7))[:3, :3]
    rng = np.random.default_rng(8)
    start = (rng.uniform(-1, 1, (6000, 3)) * (1.5, 1.5, 480)) * scale
    edge = mesh.positions[mesh.indices].astype(float)
    share = rng.uniform(0, 1, (len(edge), 1))
    targets = np.concatenate(
        [
            edge[:, 0],
            edge[:, 0] + share * (edge[:, 1] - edge[:, 0]),
            rng.normal(size=(2000, 3)) * (1, 1, 30) * scale * 1e3,
        ]
    )
    ways = targets[: len(start)] - start
    outward = np.cross(edge[:, 1] - edge[:, 0], edge[:, 2] - edge[:, 0])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    speed = ways @ outward.T
    with np.errstate(divide="ignore"):
        expected = np.where(speed > 0, ((edge[:, 0] * outward).sum(1) - start @ outward.T) / speed, np.inf).min(1)
    instances = [Instance(mesh, placed((0, 3e3 * scale * i, 0), turn=0.7)) for i in range(copies)]
    with World(gpu, Scene(instances)) as world:
        origins, directions = start @ way.T, ways @ way.T
        hits = cast(gpu, world, origins, directions)
        assert blocked(gpu, world, origins, directions).all()
    assert (hits["t"] < FAR).all()
    np.testing.assert_allclose(hits["t"], expected, rtol=1e-4)


def _turn(axis: int, quarters: int) -> NDArray[np.float64]:
    c, s = (1, 0, -1, 0)[quarters], (0, 1, 0, -1)[quarters]
    matrix = np.eye(3)
    i, j = ((1, 2), (0, 2))[axis]
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, s, -s, c
    return matrix


@pytest.mark.parametrize("kind", ["equal", "points", "growing", "line"])
def test_hard_triangles_make_a_tree_all_the_same(gpu: Gpu, kind: str) -> None:
    """A thousand times the same triangle, triangles without area, sizes that double each time."""
    count = 1000
    base = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    corners = np.broadcast_to(base, (count, 3, 3)).copy()
    if kind == "points":
        corners[1:] = 0.25
    if kind == "growing":
        corners = corners * (1.07 ** np.arange(count, dtype=np.float64))[:, None, None] / 1.07 ** (count - 3)
    if kind == "line":
        corners[1:, 2] = corners[1:, 1]
        corners[1:] += np.arange(1, count, dtype=np.float32)[:, None, None] * 1e-3
    mesh = Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count).reshape(-1, 3))
    with World(gpu, Scene([Instance(mesh)])) as world:
        assert world.depth < STACK
        x, y = np.meshgrid(np.linspace(-0.2, 1.2, 29) + 0.003, np.linspace(-0.2, 1.2, 29) + 0.004)
        origins = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
        answers = blocked(gpu, world, origins, np.broadcast_to([0, 0, -1], origins.shape))
    side = max(1.0, float(corners[..., 0].max())) if kind == "growing" else 1.0
    inside = (x > 0) & (y > 0) & (x + y < side)
    assert (answers == inside.ravel()).all()


def test_a_tree_too_deep_for_the_stack_is_made_by_pairs(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(
        [Instance(blob(200, 1)), *(Instance(mesh, placed((x, 0, 0))) for mesh in [blob(90, 2)] for x in (0, 2))]
    )
    with World(gpu, scene) as world:
        usual = world.depth
    monkeypatch.setattr("tyndall.tracing.world.STACK", 14)
    with World(gpu, scene) as world:
        assert world.depth <= 12 < usual
    assert agree(gpu, scene).any()


def test_moving_instances_is_like_building_anew(gpu: Gpu) -> None:
    mesh = blob()
    places = [placed((x, 0, 0), (0.4, 0.4, 0.4), x) for x in (-1.2, 0, 1.2)]
    still = Instance(blob(seed=9), placed((0, 1, 0)))
    moved = [placed((0, x, 0.5), (0.5, 0.3, -0.4), 2 * x) for x in (-1, 0.2, 1)]
    origins, ways = random_rays(500)
    with World(gpu, Scene([*(Instance(mesh, p) for p in places), still])) as world:
        world.move(dict(enumerate(moved)))
        hits = cast(gpu, world, origins, ways)
        world.move(dict(enumerate(places)))
        back = cast(gpu, world, origins, ways)
        with pytest.raises(ParameterError, match=r"instances\[3\]: is placed once"):
            world.move({3: places[0]})
        with pytest.raises(ParameterError, match=r"instances\[4\]: there are 4"):
            world.move({4: places[0]})
        with pytest.raises(ParameterError, match="inverse"):
            world.move({0: placed(scale=(1, 0, 1))})
    for transforms, found in ((moved, hits), (places, back)):
        with World(gpu, Scene([*(Instance(mesh, p) for p in transforms), still])) as world:
            fresh = cast(gpu, world, origins, ways)
        assert 0.1 < (fresh["t"] < FAR).mean() < 0.9
        np.testing.assert_allclose(found["t"], fresh["t"], rtol=1e-5)
        assert (found["instance"] == fresh["instance"]).mean() > 0.998


def test_equal_scenes_make_equal_trees(gpu: Gpu) -> None:
    origins, ways = random_rays(200)
    scene = Scene([Instance(blob(500, seed)) for seed in range(3)])
    results = []
    for _ in range(2):
        with World(gpu, scene) as world:
            results.append(cast(gpu, world, origins, ways))
            world.build()
            results.append(cast(gpu, world, origins, ways))
    assert all((result == results[0]).all() for result in results)


def test_nothing_is_left_on_the_device(gpu: Gpu) -> None:
    scene = Scene([Instance(blob())], camera=Camera())
    with World(gpu, scene):
        assert gpu.ledger.by_owner()["tracing"] > 0
    assert "tracing" not in gpu.ledger.by_owner()


@pytest.mark.parametrize(
    ("origins", "ways", "message"),
    [
        ([[0, 0, 0]], [[0, 0, 0]], "zero or not finite"),
        ([[0, 0, np.nan]], [[0, 0, 1]], "zero or not finite"),
        ([[0, 0]], [[0, 1]], "not \\(N, 3\\)"),
        ([[0, 0, 0]], [[0, 0, 1], [0, 1, 0]], "not \\(N, 3\\)"),
    ],
)
def test_rays_that_are_none(gpu: Gpu, origins: list[list[float]], ways: list[list[float]], message: str) -> None:
    with World(gpu, Scene([Instance(blob())])) as world, pytest.raises(ParameterError, match=message):
        cast(gpu, world, origins, ways)


def test_a_mesh_far_from_its_own_origin_keeps_its_detail(gpu: Gpu) -> None:
    """As in a georeferenced model whose nodes bring it back: two copies, each at the world's origin."""
    mesh = blob(100, 4)
    away = np.array([3e5, -2e5, 1e5], np.float32)
    # Only what float32 can hold of the far positions is compared.
    far = Mesh((mesh.positions + away).astype(np.float32), mesh.indices)
    near = Mesh((far.positions.astype(np.float64) - away).astype(np.float32), mesh.indices)
    back = placed(tuple(-away))  # type: ignore[arg-type]
    origins, ways = random_rays(400)
    with World(gpu, Scene([Instance(far, back), Instance(far, placed((1e3, 0, 0)))])) as world:
        found = cast(gpu, world, origins, ways)
    with World(gpu, Scene([Instance(near)])) as world:
        expected = cast(gpu, world, origins, ways)
    assert 0.2 < (expected["t"] < FAR).mean() < 0.98
    assert ((found["t"] < FAR) == (expected["t"] < FAR)).mean() > 0.995
    both = (found["t"] < FAR) & (expected["t"] < FAR)
    assert np.percentile(np.abs(found["t"][both] - expected["t"][both]), 98) < 1e-4


def test_rays_recorded_before_a_move_see_what_was(gpu: Gpu) -> None:
    mesh = props.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)).mesh
    scene = Scene([Instance(mesh), Instance(mesh, placed((9, 0, 0)))])
    with (
        World(gpu, scene) as world,
        gpu.buffer("rays", pack_rays(gpu, [[0, 0, 1]], [[0, 0, -1]], 0, FAR), owner="test", element=CAST_RAY) as rays,
        gpu.buffer("answers", 16, owner="test") as answers,
    ):
        gpu.compute("before", "package::tracing::cast", "cast_occluded").bind(
            world.bindings, rays=rays, answers=answers.read_write(), ray_count=gpu.constant(1)
        ).dispatch(1)
        world.move({0: placed((0, 0, 5))})
        world.move({0: placed((0, 7, 0))})
        assert gpu.read_buffer(answers)[0] == 1
        assert not blocked(gpu, world, [[0, 0, 1]], [[0, 0, -1]])[0]
        assert blocked(gpu, world, [[0, 7, 1]], [[0, 0, -1]])[0]
        gpu.forget_groups()


def test_a_world_may_close_while_passes_wait(gpu: Gpu) -> None:
    mesh = blob(10)
    world = World(gpu, Scene([Instance(mesh), Instance(mesh, placed((2, 0, 0)))]))
    world.move({0: placed((0, 1, 0))})
    world.close()
    gpu.wait()


def test_a_build_that_fails_leaves_nothing_behind(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    make = gpu.buffer

    def refuse(label: str, *arguments: object, **options: object) -> object:
        if label == "tracing.build.neighbours":
            raise GpuError("not enough memory")
        return make(label, *arguments, **options)  # type: ignore[arg-type]

    before = gpu.ledger.total
    with monkeypatch.context() as patch:
        patch.setattr(gpu, "buffer", refuse)
        with pytest.raises(GpuError, match="not enough memory"):
            World(gpu, Scene([Instance(blob())]))
    assert gpu.ledger.total == before
    assert agree(gpu, Scene([Instance(blob())]), 100).any()
