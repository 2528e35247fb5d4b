"""Outlines: what each light sees, read back from the device, against the definition on the host."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
import props
import pytest

from tyndall.content.mesh import Meshes
from tyndall.content.outline import Outline, welded
from tyndall.frame import pack_lights
from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, Instance, Light, Mesh, PointLight, Scene
from tyndall.techniques.contract import Unsupported, View
from tyndall.techniques.shadow import silhouettes as module
from tyndall.techniques.shadow.shadow_volume import ShadowVolume
from tyndall.techniques.shadow.silhouettes import Sheet, silhouettes

LIGHT = "package::wesl::light::Light"
CUBE = props.box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))

Point = tuple[float, ...]
Edge = tuple[Point, Point]


@dataclass
class Found:
    """One light's outline in the world: directed sides, as often as they are there, and caps by their corners."""

    sides: Counter[Edge]
    caps: Counter[tuple[Point, ...]]
    segments: np.ndarray


def find(gpu: Gpu, scene: Scene, sheet: Sheet = "both") -> list[Found]:
    """The outlines of a scene for each of its lights."""
    found = []
    meshes = Meshes(gpu, scene)
    rows = pack_lights(scene, gpu.dtype(LIGHT))
    lights = gpu.buffer("test.lights", rows, owner="test", element=LIGHT)
    view = View(gpu, scene, (8, 8), "test", ShadowVolume(), scope={"lights": lights.read()})
    try:
        outline = meshes.outline()
        assert isinstance(outline, Outline)
        world = _placed_vertices(meshes, scene)
        for (one,) in silhouettes(view, [outline], caps=True, segments=True, sheet=sheet):
            assert one.segments is not None
            gpu.submit()
            words = gpu.read_buffer(one.arguments).view("<u4")[one.offset // 4 :]
            corners = 3 if scene.lights[one.light].kind == "directional" else 6
            count, cap_count = int(words[0]) // corners, int(words[4]) // 3
            # Buffers hold the outlines of a batch of lights, one after the other, of equal room.
            slot = one.offset // 32
            room = len(gpu.read_buffer(one.sides).view("<u4")) // 4 // _slots(one.arguments)
            cap_room = len(gpu.read_buffer(one.caps).view("<u4")) // 4 // _slots(one.arguments)
            sides = gpu.read_buffer(one.sides).view("<u4").reshape(-1, 4)[slot * room :][:count]
            caps = gpu.read_buffer(one.caps).view("<u4").reshape(-1, 4)[slot * cap_room :][:cap_count]
            segments = gpu.read_buffer(one.segments).view("<f4").reshape(-1, 2, 4)[slot * room :][:count, :, :3]
            assert int(words[1]) == (1 if count or cap_count else int(words[1]))
            found.append(
                Found(
                    Counter((world[r[0], r[2]], world[r[1], r[2]]) for r in sides.tolist()),
                    Counter(_rotated(tuple(world[v, r[3]] for v in r[:3])) for r in caps.tolist()),
                    segments.astype(float),
                )
            )
    finally:
        view.close()
        lights.destroy()
        meshes.close()
        gpu.forget_groups()
    return found


def _slots(arguments: Any) -> int:
    return int(arguments.size_bytes) // 32


def _rotated(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """The same triangle from its least corner on."""
    first = corners.index(min(corners))
    return corners[first:] + corners[:first]


class _placed_vertices(dict[tuple[int, int], Point]):  # noqa: N801 - a function with a cache
    """By vertex in the streams and instance, the place in the world, rounded to what float32 leaves."""

    def __init__(self, meshes: Meshes, scene: Scene) -> None:
        row = 0
        for draw in meshes._draws:
            for matrix in draw.transforms:
                world = draw.mesh.positions.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
                for vertex, place in enumerate(np.round(world, 4) + 0.0):
                    self[draw.base_vertex + vertex, row] = tuple(place.tolist())
                row += 1


def expected(scene: Scene, light: Light, sheet: Sheet, *, both: bool) -> Counter[Edge]:
    """By definition: a triangle's weight along each of its edges, those of opposite directions cancelling."""
    total: Counter[Edge] = Counter()
    for instance in scene.instances:
        matrix = np.asarray(instance.transform)
        world = instance.mesh.positions.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        for corners in instance.mesh.indices:
            a, b, c = world[corners]
            way = -np.array(light.direction) if isinstance(light, DirectionalLight) else light.position - a
            faces = np.cross(b - a, c - a) @ way >= 0
            outside = faces != mirrored
            if not (outside if sheet == "facing" else both and not outside if sheet == "turned" else outside or both):
                continue
            places = [tuple((np.round(p, 4) + 0.0).tolist()) for p in (a, b, c)]
            for p, q in zip(places, places[1:] + places[:1], strict=True):
                sign = (1 if faces else -1) * (1 if p < q else -1)
                total[min(p, q), max(p, q)] += sign
    directed: Counter[Edge] = Counter()
    for (p, q), weight in total.items():
        if weight and p != q:
            directed[(p, q) if weight > 0 else (q, p)] = abs(weight)
    return directed


def net(sides: Counter[Edge]) -> Counter[Edge]:
    """Without what runs there and back: an edge of many triangles may be written as several that cancel in part."""
    return Counter({(p, q): n - sides[q, p] for (p, q), n in sides.items() if n > sides[q, p]})


def is_closed_loops(sides: Counter[Edge]) -> bool:
    balance: Counter[Point] = Counter()
    for (p, q), count in sides.items():
        balance[p] += count
        balance[q] -= count
    return not any(balance.values())


def random_mesh(seed: int, kind: str) -> Mesh:
    """Triangles that share few vertices in every way, or a bumpy ball, whole or with holes."""
    rng = np.random.default_rng(seed)
    if kind == "any":
        indices = rng.integers(0, 9, (40, 3))
        return Mesh(rng.normal(size=(9, 3)), indices[(np.diff(np.sort(indices), axis=1) > 0).all(axis=1)])
    n, m = 10, 6
    theta, phi = np.linspace(0, np.pi, m + 1)[1:-1, None], np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], -1)
    positions = np.concatenate([ring.reshape(-1, 3), [(0, 0, 1), (0, 0, -1)]]) * rng.uniform(
        0.6, 1.4, ((m - 1) * n + 2, 1)
    )
    i, j = np.arange(n), (np.arange(n) + 1) % n
    top, low = len(positions) - 2, (m - 2) * n
    faces = [np.stack([np.full(n, top), i, j], 1), np.stack([np.full(n, top + 1), low + j, low + i], 1)]
    for k in range(m - 2):
        a, b, c, d = k * n + i, k * n + j, (k + 1) * n + i, (k + 1) * n + j
        faces += [np.stack([a, c, d], 1), np.stack([a, d, b], 1)]
    triangles = np.concatenate(faces)
    if kind == "open":
        triangles = triangles[rng.random(len(triangles)) < 0.8]
    return Mesh(positions, triangles)


# --- counts that one can count -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("light", "count"),
    [
        (DirectionalLight((0, -1, 0)), 4),
        (PointLight((0.1, 3, 0.2)), 4),
        (DirectionalLight((-1, -1, -1.1)), 6),
        (PointLight((3, 3.1, 2.9)), 6),
        (PointLight((3, 3.1, 0)), 6),
        (PointLight((0.1, 0.2, 0.1)), 0),
    ],
)
def test_sides_of_a_cube(gpu: Gpu, light: Light, count: int) -> None:
    """Four along an axis, six where two or three faces are seen; none from inside, where all faces are alike."""
    (found,) = find(gpu, Scene([CUBE], [light]))
    assert sum(found.sides.values()) == count
    assert is_closed_loops(found.sides)


def test_what_casts_lies_to_the_left(gpu: Gpu) -> None:
    """Seen from above, the outline runs counter-clockwise around the middle; caps are wound for the light."""
    light = PointLight((0.2, 4, 0.1))
    (found,) = find(gpu, Scene([CUBE], [light]))
    for p, q in found.sides:
        assert np.cross(p, np.subtract(q, p))[1] > 0
    assert sum(found.caps.values()) == 2
    for corners in found.caps:
        a, b, c = map(np.array, corners)
        assert np.cross(b - a, c - a) @ (light.position - a) > 0


# --- against the definition ----------------------------------------------------------------------------------------

SOURCES: list[Light] = [
    PointLight((3, 2, 1.5)),
    DirectionalLight((0.3, -1, 0.2)),
    PointLight((-0.5, -3, 2)),
    DirectionalLight((-1, 0.1, -0.4)),
    PointLight((0.2, 5, -3)),
]


@pytest.mark.parametrize("kind", ["closed", "open", "any"])
@pytest.mark.parametrize("seed", range(4))
def test_outlines_are_closed_loops_and_those_of_the_definition(gpu: Gpu, kind: str, seed: int) -> None:
    """All lights at once; of what casts with both sides, the two sheets are all of it."""
    scene = Scene([Instance(random_mesh(seed, kind))], SOURCES)
    both = kind != "closed"
    whole, facing, turned = (find(gpu, scene, sheet) for sheet in ("both", "facing", "turned"))  # type: ignore[arg-type]
    assert len(whole) == len(SOURCES)
    for light, w, f, t in zip(SOURCES, whole, facing, turned, strict=True):
        assert w.sides
        for sheet, got in (("both", w), ("facing", f), ("turned", t)):
            assert is_closed_loops(got.sides)
            assert net(got.sides) == expected(scene, light, sheet, both=both)  # type: ignore[arg-type]
        assert w.caps == f.caps + t.caps
        assert net(w.sides) == net(f.sides + t.sides)
        assert bool(t.caps) == both
    assert whole[0].sides != whole[2].sides


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_placed_meshes_cast_where_they_stand(gpu: Gpu, kind: str) -> None:
    """Mirrored, sheared and far from one another; many of one mesh among others."""
    rng = np.random.default_rng(8)
    mesh, other = random_mesh(1, kind), random_mesh(2, kind)
    instances = []
    for i in range(9):
        matrix = np.eye(4)
        matrix[:3, :3] = rng.normal(size=(3, 3))
        matrix[:3, 3] = 8 * i
        instances.append(Instance(other if i % 3 == 2 else mesh, matrix.tolist()))
    determinants = [np.linalg.det(np.array(i.transform)[:3, :3]) for i in instances]
    assert min(determinants) < 0 < max(determinants)
    scene = Scene(instances, SOURCES)
    for light, got in zip(SOURCES, find(gpu, scene), strict=True):
        assert is_closed_loops(got.sides)
        assert net(got.sides) == expected(scene, light, "both", both=kind == "open")


def test_segments_are_the_ends_of_the_sides(gpu: Gpu) -> None:
    for got in find(gpu, Scene([Instance(random_mesh(3, "open"))], SOURCES)):
        ends = Counter(tuple(tuple((np.round(p, 4) + 0.0).tolist()) for p in pair) for pair in got.segments)
        assert ends == got.sides


def test_batches_of_lights_are_as_all_at_once(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene([Instance(random_mesh(0, "open")), CUBE], [*SOURCES, PointLight((0.1, 0.2, 0.1)), *SOURCES[:3]])
    at_once = find(gpu, scene)
    for size in (1, 40_000):
        monkeypatch.setattr(module, "_BATCH_BYTES", size)
        for one, other in zip(find(gpu, scene), at_once, strict=True):
            assert one.sides == other.sides
            assert one.caps == other.caps


def test_more_edges_than_a_buffer_holds_are_refused_in_a_line(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(gpu.limits, "max-storage-buffer-binding-size", 1 << 10)
    with pytest.raises(Unsupported, match=r"^shadow_volume: [\d,]+ edges .*use shadow_map$") as caught:
        find(gpu, Scene([Instance(random_mesh(0, "closed"))], SOURCES))
    assert "\n" not in str(caught.value)


# --- lights in surfaces --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("position", [(0.1, 0.5, 0.17), (0.1, 0.5, 0.1), (0.5, 0.5, 0.2), (0.5, 0.5, 0.5)])
def test_what_a_light_touches_has_no_say_and_the_rest_casts(gpu: Gpu, position: tuple[float, float, float]) -> None:
    """In a side, in its diagonal, in an edge, at a vertex: the outline is that of the triangles that it is not in."""
    (found,) = find(gpu, Scene([CUBE], [PointLight(position)]))
    touched = 0
    for corners in CUBE.mesh.indices:
        a, b, c = CUBE.mesh.positions[corners].astype(float)
        normal = np.cross(b - a, c - a)
        inner = [np.cross(q - p, position - p) @ normal >= -1e-9 for p, q in ((a, b), (b, c), (c, a))]
        touched += abs(normal @ (position - a)) < 1e-9 and all(inner)
    assert touched > 0
    assert sum(found.caps.values()) == 12 - touched
    assert found.sides
    assert is_closed_loops(found.sides)


def test_welding_keeps_the_loops_closed_over_seams(gpu: Gpu) -> None:
    """Every triangle has vertices of its own, at equal positions."""
    mesh = random_mesh(2, "closed")
    split = Mesh(mesh.positions[mesh.indices.ravel()], np.arange(mesh.indices.size).reshape(-1, 3))
    assert len(np.unique(welded(split.positions))) == len(mesh.positions)
    for one, other in zip(
        find(gpu, Scene([Instance(split)], SOURCES)), find(gpu, Scene([Instance(mesh)], SOURCES)), strict=True
    ):
        assert one.sides == other.sides
