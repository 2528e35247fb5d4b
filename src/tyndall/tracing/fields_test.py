"""Rays meet implicit surfaces where closed forms say, at any scale; leave them without acne or leaks; and stop at the
nearer of a mesh and an implicit surface.
"""

from __future__ import annotations

import itertools

import numpy as np
import props
import pytest
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, _all_bound, _bindings_module
from tyndall.scene.model import Implicit, Instance, Mat4, Material, Scene
from tyndall.sdf import box, sphere
from tyndall.tracing.cast import blocked, cast, pack_rays
from tyndall.tracing.world import World

Floats = NDArray[np.float64]
FAR = 1e9
FIELD = 1 << 31  # as tracing/rays.wesl has it
_PROBE = """
import package::bindings::rays;
import package::tracing::rays::{closest, occluded, offset_origin};
import package::tracing::surface::surface_at;
import package::wesl::camera::FAR;
fn evaluate(x: vec4f) -> vec4f {
    let ray = rays[u32(x.x)];
    let hit = closest(ray.origin, ray.direction, ray.near, ray.far, true);
    if hit.t >= FAR {
        return vec4f(0.0, 0.0, 0.0, -1.0);
    }
    let s = surface_at(hit, ray.origin, ray.direction);
    if x.y == 0.0 {
        return vec4f(s.position, hit.t);
    }
    if x.y == 1.0 {
        return vec4f(s.geometric, 1.0);
    }
    if x.y == 2.0 {
        return vec4f(s.surface.albedo, s.surface.roughness);
    }
    if x.y == 3.0 {
        return vec4f(s.emissive, s.surface.metallic);
    }
    let onward = rays[u32(x.z)];
    let origin = offset_origin(s.position, s.geometric);
    return vec4f(select(0.0, 1.0, occluded(origin, onward.direction, 0.0, onward.far)), 0.0, 0.0, 1.0);
}
"""
_number = itertools.count()


def probe(gpu: Gpu, world: World, origins: Floats, ways: Floats, *kinds: int, onward: Floats | None = None) -> Floats:
    """(kinds, N, 4): what the probe's shader says of each ray; kind 4 asks what lies in the way from there on."""
    count = len(origins)
    then = ways if onward is None else onward
    rays = pack_rays(gpu, np.concatenate([origins, origins]), np.concatenate([ways, then]), 0.0, FAR)
    rows = np.array([(i, kind, count + i, 0) for kind in kinds for i in range(count)], np.float32)
    with gpu.buffer("test.rays", rays, owner="test", element="package::tracing::cast::CastRay") as buffer:
        scope = {**world.bindings, "rays": buffer.read()}
        found = props.evaluate(gpu, f"fields_probe{next(_number)}", _PROBE, rows, scope)
    return found.reshape(len(kinds), count, 4).astype(float)


def unit(v: Floats) -> Floats:
    result: Floats = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return result


def placed(
    move: tuple[float, float, float] = (0, 0, 0), scale: tuple[float, float, float] = (1, 1, 1)
) -> tuple[tuple[float, ...], ...]:
    matrix = np.diag([*scale, 1.0])
    matrix[:3, 3] = move
    return tuple(tuple(row) for row in matrix.tolist())


def rays_at(radius: float, count: int = 400, seed: int = 0) -> tuple[Floats, Floats]:
    """From up to ten radii away to somewhere about the shape; the numbers are those of float32."""
    rng = np.random.default_rng(seed)
    origins = unit(rng.normal(size=(count, 3))) * rng.uniform(1.8, 10, (count, 1)) * radius
    ways = rng.uniform(-1.3, 1.3, (count, 3)) * radius - origins
    return origins.astype(np.float32).astype(float), ways.astype(np.float32).astype(float)


def ball_hits(origins: Floats, ways: Floats, radius: float) -> tuple[Floats, Floats]:
    """(N,) distances in lengths of the ways, inf where a ray misses the sphere around 0, and (N, 3) normals there."""
    a, b = (ways * ways).sum(1), (origins * ways).sum(1)
    root = b * b - a * ((origins * origins).sum(1) - radius * radius)
    with np.errstate(invalid="ignore"):
        t = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    t = np.where(t > 0, t, np.inf)
    return t, unit(origins + np.where(np.isfinite(t), t, 0)[:, None] * ways)


def box_hits(origins: Floats, ways: Floats, half: float) -> tuple[Floats, Floats]:
    """As :func:`ball_hits`, of a cube."""
    with np.errstate(divide="ignore"):
        near = np.minimum((-half - origins) / ways, (half - origins) / ways)
        far = np.maximum((-half - origins) / ways, (half - origins) / ways)
    enter, axis = near.max(1), near.argmax(1)
    t = np.where((enter < far.min(1)) & (enter > 0), enter, np.inf)
    normals = np.zeros_like(origins)
    rows = np.arange(len(origins))
    normals[rows, axis] = -np.sign(ways[rows, axis])
    return t, normals


SCALES = (1e-3, 1.0, 1e3)
SOLIDS = [
    pytest.param(lambda size: sphere(size), ball_hits, id="ball"),
    pytest.param(lambda size: box(2 * size), box_hits, id="box"),
]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("make", "hits"), SOLIDS)
def test_a_hit_is_where_the_closed_form_says(gpu: Gpu, make: object, hits: object, scale: float) -> None:
    """To a few of the last places of the largest coordinate that took part."""
    origins, ways = rays_at(scale)
    t, normals = hits(origins, ways, scale)  # type: ignore[operator]
    there = np.isfinite(t)
    with World(gpu, Scene(implicits=[Implicit(make(scale))])) as world:  # type: ignore[operator]
        place, normal = probe(gpu, world, origins, ways, 0, 1)
        hit = cast(gpu, world, origins, ways)
        answers = blocked(gpu, world, origins, ways)
    assert 0.3 < there.mean() < 0.98
    assert ((hit["t"] < FAR) == there).mean() > 0.995, "a ray may touch"
    assert (answers == (hit["t"] < FAR)).all()
    both = there & (hit["t"] < FAR)
    assert (hit["primitive"][both] == FIELD).all()
    assert not hit["instance"].any()
    exact = origins[both] + t[both, None] * ways[both]
    # Along the ray, a distance off the surface counts by the sine of the angle between them.
    sine = -(normals[both] * unit(ways[both])).sum(1)
    largest = np.abs(origins[both]).max(1)
    off = np.linalg.norm(place[both, :3] - exact, axis=1) * sine / largest
    assert np.percentile(off, 99) < 2e-6
    assert np.percentile(np.abs(normal[both, :3] - normals[both]).max(1), 98) < 2e-3


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("make", "hits"), SOLIDS)
def test_rays_that_leave_meet_what_is_there(gpu: Gpu, make: object, hits: object, scale: float) -> None:
    """From a convex solid: nothing above its horizon, itself below; the place may be far from the origin too."""
    origins, ways = rays_at(scale)
    t, normals = hits(origins, ways, scale)  # type: ignore[operator]
    there = np.isfinite(t)
    onward = unit(np.random.default_rng(2).normal(size=origins.shape))
    rise = (onward * normals).sum(1)
    with World(gpu, Scene(implicits=[Implicit(make(scale))])) as world:  # type: ignore[operator]
        answer = probe(gpu, world, origins, ways, 4, onward=onward)[0]
    found = there & (answer[:, 3] > 0)
    hidden = answer[:, 0] > 0.5
    assert (found & (rise > 0.01) & hidden).sum() == 0, "acne"
    assert (found & (rise < -0.01) & ~hidden).sum() == 0, "leaks"


STRETCHED, AWAY = placed(scale=(1, 1, 0.05)), placed((900, 20, -600))
HARD = [  # an implicit surface, the transform that makes it of a unit ball, and its least slope
    pytest.param(Implicit(sphere(1.0).scale((1, 1, 0.05))), STRETCHED, 0.05, id="stretched shape"),
    pytest.param(Implicit(sphere(1.0), STRETCHED), STRETCHED, 1.0, id="stretched object"),
    pytest.param(Implicit(sphere(1.0), AWAY), AWAY, 1.0, id="far away"),
    pytest.param(Implicit(sphere(1.0).at(900, 20, -600), placed((-900, -20, 600))), placed(), 1.0, id="far inside"),
    pytest.param(Implicit(sphere(900.0).at(0, -900, 0)), placed((0, -900, 0), (900, 900, 900)), 1.0, id="planet"),
]


@pytest.mark.parametrize(("implicit", "place", "slope"), HARD)
def test_rays_leave_whatever_the_numbers_are_like(gpu: Gpu, implicit: Implicit, place: Mat4, slope: float) -> None:
    """Where values are less than distances, and where coordinates are large beside the shape."""
    matrix = np.array(place)
    rng = np.random.default_rng(4)
    target = unit(rng.normal(size=(400, 3)))
    if matrix[1, 1] > 100:  # near the top, where the world's coordinates are small
        target = unit(np.array([0, 1, 0]) + 1e-3 * rng.normal(size=(400, 3)))
    goal = target @ matrix[:3, :3].T + matrix[:3, 3]
    outward = unit(target @ np.linalg.inv(matrix[:3, :3]))
    origins = (goal + 2 * unit(outward + 0.5 * rng.normal(size=goal.shape))).astype(np.float32).astype(float)
    ways = (goal - origins).astype(np.float32).astype(float)
    back = np.linalg.inv(matrix)
    t, local = ball_hits(origins @ back[:3, :3].T + back[:3, 3], ways @ back[:3, :3].T, 1.0)
    there = np.isfinite(t)
    normals = unit(local @ back[:3, :3])
    onward = unit(rng.normal(size=origins.shape))
    with World(gpu, Scene(implicits=[implicit])) as world:
        position, normal, answer = probe(gpu, world, origins, ways, 0, 1, 4, onward=onward)
    found = there & (position[:, 3] > 0)
    assert found.sum() > 150
    assert (found == there).mean() > 0.99
    exact = origins + np.where(there, t, 0)[:, None] * ways
    above = ((position[:, :3] - exact) * normals).sum(1)
    # It may lie higher than the numbers ask for, so that values are clear of the march's threshold.
    largest = max(np.abs(origins).max(), np.abs(implicit.bounds).max(), np.abs(implicit.shape.box).max())
    assert np.percentile(np.abs(above[found]), 98) < 4e-6 * largest / slope
    assert np.percentile(np.abs(normal[found, :3] - normals[found]).max(1), 90) < 2e-3 + 2e-5 * largest / matrix[1, 1]
    # From there the ball is in the way or not, to a hair.
    start = position[:, :3] + normal[:, :3] * (4e-6 * np.abs(position[:, :3]).max(1, keepdims=True))
    start, way = start @ back[:3, :3].T + back[:3, 3], unit(onward @ back[:3, :3].T)
    nearest = np.maximum(-(start * way).sum(1), 0)
    depth = 1 - np.linalg.norm(start + nearest[:, None] * way, axis=1)  # in radii, of the ray's lowest place
    hidden = answer[:, 0] > 0.5
    assert (found & (nearest == 0)).sum() > 50
    hair = 1e-5 + 4e-6 * largest / matrix[1, 1]
    assert (found & (depth < -hair) & hidden).sum() == 0, "acne"
    assert (found & (depth > hair) & ~hidden).sum() == 0, "leaks"


def test_rays_along_a_surface_come_to_an_answer(gpu: Gpu) -> None:
    """Steps are as long as the surface is near: a march's own steps would end a few metres on. What meets the floor at
    a flat angle meets it where it does, what leaves it leaves, and a wall far along it is not missed.
    """
    ground = box((200.0, 2.0, 200.0)).at(0, -1, 0) | box((1.0, 3.0, 200.0)).at(20.5, 0, 0)
    heights = np.array([1e-3, 0.3, 1.7, 0.01, 0.05, 1e-3, 1e-4])
    slopes = np.array([-4e-3, -0.02, -0.1, 0, 0, 0, 1e-3])
    meets = np.array([0.25, 15.0, 17.0, 20.0, 20.0, np.inf, np.inf])
    ways = np.stack([np.ones(7), slopes, np.zeros(7)], axis=1)
    ways[5:] = ways[5:, [2, 1, 0]]  # along the wall
    origins = np.stack([np.zeros(7), heights, np.zeros(7)], axis=1)
    with World(gpu, Scene(implicits=[Implicit(ground)])) as world:
        hit = cast(gpu, world, origins, ways)["t"]
        answers = blocked(gpu, world, origins, ways)
    assert (hit < FAR).tolist() == np.isfinite(meets).tolist() == answers.tolist()
    np.testing.assert_allclose(hit[:5], meets[:5], rtol=1e-2)
    np.testing.assert_allclose(hit[1:5], meets[1:5], rtol=1e-3)


def test_the_nearer_of_a_mesh_and_an_implicit_surface_is_hit(gpu: Gpu) -> None:
    red = Material(base_color=(0.8, 0.1, 0.2, 1), roughness=0.3, metallic=0.25, emissive=(1, 2, 3))
    blue = Material(base_color=(0.1, 0.2, 0.8, 1), roughness=0.7)
    walls = [props.wall(-1.5, material=blue), props.wall(2.5, half=0.5, material=blue)]
    scene = Scene(walls, implicits=[Implicit(sphere(1.0), material=red)])
    origins = np.array([(0, 0, 4), (0, 0.8, 4), (0.9, 0.9, 4), (0, 0, 2)], float)
    ways = np.array([(0, 0, -2)] * 4, float)
    with World(gpu, scene) as world:
        hit = cast(gpu, world, origins, ways)
        colour, glow = probe(gpu, world, origins, ways, 2, 3)
        short = blocked(gpu, world, origins, ways, far=[0.7, 1.5, 2.7, 0.45])
    np.testing.assert_allclose(hit["t"], [0.75, 1.7, 2.75, 0.5], rtol=1e-5)
    assert hit["primitive"].tolist()[1::2] == [FIELD, FIELD]
    assert hit["instance"].tolist() == [1, 0, 0, 0]
    assert not short.any()
    for i, material in enumerate((blue, red, blue, red)):
        np.testing.assert_allclose(colour[i], [*material.base_color[:3], material.roughness], atol=2e-3)
        np.testing.assert_allclose(glow[i], [*material.emissive, material.metallic], atol=2e-3)


def test_a_scene_of_meshes_has_no_code_for_implicit_surfaces(gpu: Gpu) -> None:
    """Nor one of its bindings."""
    texts = {}
    for name, scene in (
        ("meshes", Scene([props.wall(-1)])),
        ("both", Scene([props.wall(-1)], implicits=[Implicit(box())])),
    ):
        with World(gpu, scene) as world:
            bound = _all_bound({**world.bindings, "rays": gpu.constant(0), "hits": gpu.constant(0)})
            assert any(b.startswith("implicit") for b in bound) == (name == "both")
            text = _bindings_module(tuple(bound), tuple(b.slot for b in bound.values()))
            text += "const ray_count = 1u; const cull = 0u; const answers = 0u;"
            texts[name] = gpu.linker.link("package::tracing::cast", ("cast_closest",), text, {}, {}).wgsl
    assert "march" not in texts["meshes"]
    assert "march" in texts["both"]


def test_nothing_is_left_on_the_device(gpu: Gpu) -> None:
    before = gpu.ledger.by_owner()
    with World(gpu, Scene([Instance(props.wall(-1).mesh)], implicits=[Implicit(sphere(1.0))])) as world:
        held = sum(resource.size_bytes for resource in world.resources())
        assert held == gpu.ledger.total - sum(before.values())
    assert gpu.ledger.by_owner() == before
