"""Meshes as shapes: the sampled distances are true, the bounds hold, and the device has the same values."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Mesh
from tyndall.sdf import Grid, Shape, Y, box, from_mesh, load, save, sphere, union
from tyndall.sdf.field import Field
from tyndall.sdf.grid import Triangles

CUBE = props.box((-1, -1, -1), (1, 1, 1)).mesh


@cache
def bowl() -> Grid:
    """Concave, of a mesh of our own."""
    return from_mesh((sphere(1) - sphere(0.8).at(0.9, 0.3)).to_mesh(24), 32)


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    indices = [mesh.indices + np.uint32(start) for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.positions for mesh in meshes]), np.concatenate(indices))


def moved(mesh: Mesh, offset: float, scale: float = 1.0) -> Mesh:
    return Mesh((mesh.positions * scale + np.float32(offset)).astype(np.float32), mesh.indices)


def lattice(grid: Grid) -> np.ndarray:
    """(z, y, x, 3) where the samples are."""
    z, y, x = np.indices(grid.samples.shape)
    return np.array(grid.low) + np.stack([x, y, z], axis=-1) * grid.step


def test_the_distance_to_a_triangle() -> None:
    """Against the least distance to many places on it; also of one that is a line."""
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(4, 3, 3))
    corners[3, 2] = 0.3 * corners[3, 0] + 0.7 * corners[3, 1]
    triangles = Triangles(corners)
    places = 2 * rng.normal(size=(100, 3))
    s, t = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201))
    weights = np.stack([1 - s, s * (1 - t), s * t], axis=-1).reshape(-1, 3)
    for i, triangle in enumerate(corners):
        on = weights @ triangle
        expected = np.array([np.linalg.norm(on - place, axis=1).min() for place in places])
        found = np.sqrt(triangles.square(np.full(len(places), i), places))
        np.testing.assert_allclose(found, expected, atol=0.01)
        assert (found <= expected + 1e-12).all()


def test_samples_of_a_cube_are_its_distances() -> None:
    """Twelve triangles, each far greater than a cell; also by a mesh wound inwards."""
    for mesh in (CUBE, Mesh(CUBE.positions, CUBE.indices[:, ::-1])):
        grid = from_mesh(mesh, 16)
        expected = box(2)(lattice(grid).reshape(-1, 3)).reshape(grid.samples.shape)
        np.testing.assert_allclose(grid.samples, expected, atol=1e-6)


def test_samples_of_many_triangles() -> None:
    """True within a cell of the surface; never less anywhere, and hardly more."""
    shape = sphere(1) - sphere(0.8).at(0.9, 0.3)
    mesh = shape.to_mesh(24)
    grid, triangles = bowl(), Triangles(mesh.positions[mesh.indices].astype(float))
    rng = np.random.default_rng(2)
    chosen = rng.choice(grid.samples.size, 300, replace=False)
    places = lattice(grid).reshape(-1, 3)[chosen]
    each = np.arange(len(triangles.corners))
    true = np.array([np.sqrt(triangles.square(each, np.broadcast_to(p, (len(each), 3))).min()) for p in places])
    found = np.abs(grid.samples.reshape(-1)[chosen])
    near = true < grid.step
    assert near.sum() > 20
    np.testing.assert_allclose(found[near], true[near], atol=1e-6)
    assert (found >= true - 1e-6).all()
    assert (found - true).max() < 0.3 * grid.step
    value = shape(places)
    clear = np.abs(value) > 0.02
    assert ((grid.samples.reshape(-1)[chosen] < 0) == (value < 0))[clear].all()


def test_bodies_that_overlap_or_hold_one_another() -> None:
    """Winding numbers of 2 are inside; a body inside out within another is a hollow."""
    overlapping = from_mesh(joined(CUBE, moved(CUBE, 0.5)), 24)
    apart = np.abs(lattice(overlapping).reshape(-1, 3) - np.array([[[0.0]], [[0.5]]])).max(axis=-1) - 1
    value = apart.min(axis=0)
    clear = np.abs(value) > 1e-3
    np.testing.assert_array_equal((overlapping.samples.reshape(-1) < 0)[clear], (value < 0)[clear])
    inner = moved(CUBE, 0, 0.5)
    hollow = from_mesh(joined(CUBE, Mesh(inner.positions, inner.indices[:, ::-1])), 24)
    assert hollow([[0, 0, 0], [0.75, 0, 0], [1.1, 0, 0]]) == pytest.approx([0.5, -0.25, 0.1], abs=0.02)


def test_it_is_lipschitz_inside_and_outside() -> None:
    """Pairs of places near and far; and the greatest slope of all is what is declared."""
    grid = bowl()
    assert 1 <= grid.lipschitz <= np.sqrt(3) * 1.001
    rng = np.random.default_rng(3)
    for spread in (1e-3, 0.05, 1.0):
        p = rng.uniform(-2.5, 2.5, (20_000, 3))
        q = p + rng.normal(size=p.shape) * spread
        slope = np.abs(grid(p) - grid(q)) / np.linalg.norm(p - q, axis=1)
        assert slope.max() <= grid.lipschitz * (1 + 1e-6)
    kink = np.zeros((3, 3, 3)) + 1
    kink[1, 1, 1] = -1
    steep = Grid(kink, (0, 0, 0), 1.0)
    assert steep.lipschitz == pytest.approx(np.sqrt(12))
    h = 1e-6
    corner = np.array([[1 - h, 1 - h, 1 - h], [1 - h, 1 - h, 1 - h]]) + np.array([[0.0], [h / 10]])
    a, b = steep(corner)
    assert abs(a - b) / (np.sqrt(3) * h / 10) == pytest.approx(np.sqrt(12), rel=1e-3)


def test_outside_the_lattice_it_is_never_more_than_the_distance() -> None:
    grid = from_mesh(sphere(1).to_mesh(32), 32)
    rng = np.random.default_rng(4)
    p = rng.uniform(-6, 6, (5000, 3))
    true = sphere(1)(p)
    assert (grid(p) <= true + 0.02).all()
    assert (grid(p)[true > 1] > 0.7 * true[true > 1]).all()


@pytest.mark.parametrize("level", [0.0, 0.07, 0.4, 3.0])
@pytest.mark.parametrize("shape", ["bowl", "cube"])
def test_the_extent_holds_all_that_is_below_a_level(shape: str, level: float) -> None:
    grid = bowl() if shape == "bowl" else from_mesh(CUBE, 8)
    p = np.random.default_rng(5).uniform(-1.2 - level, 1.2 + level, (20_000, 3))
    held = p[grid(p) <= level]
    low, high = grid.extent(level)
    assert (held >= low).all()
    assert (held <= high).all()
    # And it is no wider than it must be, to a cell or two and the lattice's margin.
    assert (low > -1 - level - 3.1 * grid.step).all()
    assert (high < 1 + level + 3.1 * grid.step).all()


def test_a_surface_comes_back() -> None:
    """Shape → mesh → shape → mesh: the same volume."""
    shape: Shape = from_mesh(sphere(1).to_mesh(32), 32)
    mesh = shape.to_mesh(32)
    assert np.abs(np.linalg.norm(mesh.positions, axis=1) - 1).max() < 0.02


def test_it_is_saved_as_plain_data_and_is_equal_then() -> None:
    grid = bowl()
    text = json.dumps(grid.to_data())
    again = Grid.from_data(json.loads(text))
    assert again == grid
    assert hash(again) == hash(grid)
    assert again != from_mesh(CUBE, 8)
    for change in ({"samples": "0"}, {"counts": [3, 3]}, {"counts": [9, 9, 9]}, {"counts": [1 << 20] * 3}, {"low": 1}):
        with pytest.raises(ParameterError) as error:
            Grid.from_data({**grid.to_data(), **change})
        assert "\n" not in str(error.value)


def test_it_is_in_files_of_shapes(tmp_path: Path) -> None:
    shape = bowl().at(0.5) - sphere(0.4).at(1)
    save(shape, tmp_path / "bowl.json")
    assert load(tmp_path / "bowl.json") == shape


def test_one_line_says_what_is_wrong() -> None:
    with pytest.raises(ParameterError, match=r"mesh: it is not closed \(3 edges have no partner\)"):
        from_mesh(Mesh(CUBE.positions, CUBE.indices[1:]))
    flipped = CUBE.indices.copy()
    flipped[0] = flipped[0, ::-1]
    with pytest.raises(ParameterError, match="not closed"):
        from_mesh(Mesh(CUBE.positions, flipped))
    with pytest.raises(ParameterError, match="resolution: 3 is outside 4 … 256"):
        from_mesh(CUBE, 3)
    with pytest.raises(ParameterError, match="the surface reaches the edge"):
        Grid(np.full((2, 2, 2), -1.0), (0, 0, 0), 1.0)
    with pytest.raises(ParameterError, match="nothing is inside"):
        Grid(np.full((2, 2, 2), 1.0), (0, 0, 0), 1.0)


def test_the_device_has_the_same_values(gpu: Gpu) -> None:
    """In the lattice, on its faces and outside; samples behind other slots."""
    grid = bowl()
    numbers = np.array(grid.numbers, np.float32)
    numbers[0] = 3
    payload = np.pad(grid.payload, (0, -grid.payload.size % 4)).reshape(-1, 4)
    slots = np.concatenate([numbers.reshape(2, 4), np.full((1, 4), np.nan, np.float32), payload])
    places = np.random.default_rng(6).uniform(-2.5, 2.5, (4096, 4)).astype(np.float32)
    places[:1000, :3] *= 0.4
    places[1000:1100, 0] = np.float32(grid.low[0])
    places[1100] = (*grid.low, 0)
    text = """
        import package::bindings::implicit_slots;
        import package::sdf::grid::grid;
        fn evaluate(x: vec4f) -> vec4f {
            return vec4f(grid(x.xyz, implicit_slots[0], implicit_slots[1]));
        }
    """
    buffer = gpu.buffer("test.slots", slots.astype(np.float32), owner="test", element="vec4f")
    try:
        found = props.evaluate(gpu, "test_sdf_grid", text, places, {"implicit_slots": buffer.read()})[:, 0]
    finally:
        buffer.destroy()
    np.testing.assert_allclose(found, grid(places[:, :3]), atol=3e-6)


def test_in_a_field_it_blends_and_is_marched(gpu: Gpu) -> None:
    """Two copies of one grid, joined with a ball: rays meet the surface where the numpy values are 0."""
    grid = bowl()
    shape = union(grid.at(-1.2), grid.rotate(1.0, Y).scale(0.7).at(1.2), sphere(0.6), smooth=0.3)
    text = """
        import package::sdf::march::march_closest;
        fn evaluate(x: vec4f) -> vec4f {
            let hit = march_closest(vec3f(x.xy, 4.0), vec3f(0.0, 0.0, -1.0), 0.0, 10.0, 0.0);
            return vec4f(hit.t, f32(hit.steps), 0.0, 0.0);
        }
    """
    rays = np.random.default_rng(7).uniform(-1, 1, (1000, 4)).astype(np.float32) * np.float32([2.5, 1.2, 0, 0])
    with Field(gpu, [Implicit(shape)]) as field:
        field.update()
        found = props.evaluate(gpu, "test_sdf_grid_field", text, rays, field.bindings)
    hit = found[:, 0] < 10
    depths = np.linspace(4, -4, 200)
    places = np.concatenate([np.repeat(rays[:, None, :2], 200, axis=1), np.tile(depths[:, None], (1000, 1, 1))], axis=2)
    inside = (shape(places.reshape(-1, 3)).reshape(1000, 200) < 0).any(axis=1)
    assert 0.2 < inside.mean() < 0.9
    assert not (inside & ~hit).any()
    assert (hit & ~inside).mean() < 0.02  # glancing ones, between two places
    there = np.stack([*rays[hit, :2].T, 4 - found[hit, 0]], axis=1)
    assert np.abs(shape(there)).max() < 1e-4
    assert np.median(found[hit, 1]) < 40
