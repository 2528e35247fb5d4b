"""Literal code gives what the shapes give in float64, for any tree, and says which material is nearest."""

from __future__ import annotations

import itertools

import numpy as np
import props
import pytest
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Material
from tyndall.sdf.literal import Literal, literal, moved, number
from tyndall.sdf.modifiers import Round
from tyndall.sdf.profiles import PROFILES
from tyndall.sdf.shape import Combination, Floats, Primitive, Shape, intersection, rotation, subtraction, union
from tyndall.sdf.solids import SOLIDS, box, sphere

RED, BLUE = Material("red", (1, 0, 0, 1)), Material("blue", (0, 0, 1, 1), metallic=1.0, emissive=(1, 2, 3))
_serial = itertools.count()
BLENDS = ("polynomial", "exponential", "root")
RUN = """
fn evaluate(x: vec4f) -> vec4f {
    let index = scene_material(x.xyz);
    let surface = scene_surface(index);
    return vec4f(scene_distance(x.xyz), f32(index), surface.base_color.x, surface.roughness);
}
"""


def evaluate(
    gpu: Gpu, code: Literal, points: NDArray[np.float64], moves: dict[str, Floats] | None = None
) -> NDArray[np.float32]:
    rows = np.concatenate([points, np.zeros((len(points), 1))], axis=1).astype(np.float32)
    text = ("import package::bindings::scene_rows;\n" if code.lists else "") + code.text + RUN
    with gpu.buffer("test.rows", code.rows(moves), owner="test", element="vec4f") as listed:
        return props.evaluate(gpu, f"test_literal_{next(_serial)}", text, rows, {"scene_rows": listed.read()})


def some_points(count: int = 4000, reach: float = 3.0, seed: int = 7) -> NDArray[np.float64]:
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3)).astype(np.float32).astype(np.float64)


def random_shape(rng: np.random.Generator, depth: int) -> Shape:
    """Any tree of the nodes that there are."""
    if depth == 0:
        shape: Shape = sphere(rng.uniform(0.2, 1)) if rng.random() < 0.5 else box(tuple(rng.uniform(0.3, 1.5, 3)))
    else:
        kind = rng.integers(5)
        count = int(rng.integers(2, 6))
        if kind < 3:
            join = (union, intersection, subtraction)[kind if depth > 1 else 0]
            smooth = float(rng.choice([0, rng.uniform(0.05, 0.5)]))
            parts = [random_shape(rng, depth - 1) for _ in range(count)]
            shape = join(*parts, smooth=smooth, blend=str(rng.choice(BLENDS)))  # type: ignore[arg-type]
        else:
            shape = Round(random_shape(rng, depth - 1), float(rng.uniform(0, 0.2)))
    for _ in range(rng.integers(3)):
        match rng.integers(6):
            case 0:
                shape = shape.at(*rng.uniform(-1, 1, 3))
            case 1:
                shape = shape.rotate(rng.uniform(0, 6), tuple(rng.normal(size=3)))
            case 2:
                shape = shape.orient((1, 0, 0)).named("part")
            case 3:
                shape = shape.scale(rng.uniform(0.5, 1.5))
            case 4:
                shape = shape.scale(tuple(rng.uniform(0.5, 1.5, 3)))
            case 5:
                shape = shape.material(RED if rng.random() < 0.5 else BLUE)
    return shape


@pytest.mark.parametrize("seed", range(6))
def test_it_equals_the_shapes_of_random_trees(gpu: Gpu, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = [random_shape(rng, 3) for _ in range(2)]
    turned = rotation(0.3, (1, 2, 3)) @ np.diag([2.0, 2, 2, 1])
    turned[:3, 3] = 0.5, -1, 0.25
    objects = [Implicit(shapes[0]), Implicit(shapes[1], tuple(map(tuple, turned)))]
    points = some_points()
    found = evaluate(gpu, literal(objects), points)[:, 0]
    expected = np.minimum(shapes[0](points), shapes[1].transform(turned)(points))
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5)


def test_the_material_is_that_of_the_nearest_part(gpu: Gpu) -> None:
    left, right = sphere(0.5).at(-1).material(RED), sphere(0.5).at(1).material(BLUE)
    shape = union(left, right, smooth=0.1)
    code = literal([Implicit(shape), Implicit(box(0.5).at(0, 2), material=Material("plain", roughness=0.25))])
    points = some_points()
    found = evaluate(gpu, code, points)
    assert set(code.materials) == {RED, BLUE, Material("plain", roughness=0.25)}
    values = np.array([left(points), right(points), box(0.5).at(0, 2)(points)])
    order = np.sort(values, axis=0)
    clear = order[1] - order[0] > 0.12  # where the blend cannot decide between the box and the spheres
    numbers = [code.materials.index(m) for m in (RED, BLUE, Material("plain", roughness=0.25))]
    np.testing.assert_array_equal(found[clear, 1], np.array(numbers)[values.argmin(axis=0)][clear])
    red = found[:, 1] == code.materials.index(RED)
    assert red.any()
    assert (found[red, 2] == 1).all()
    assert (found[found[:, 1] == numbers[2], 3] == 0.25).all()


def test_what_cuts_shows_where_it_has_a_material_of_its_own(gpu: Gpu) -> None:
    parts = [box(2).material(RED), sphere(1.2).material(BLUE)]
    points = some_points(reach=1.5)
    both = literal([Implicit(intersection(*parts))])
    expected = [both.materials.index(m) for m in (RED, BLUE)]
    greater = parts[1](points) > parts[0](points)
    np.testing.assert_array_equal(evaluate(gpu, both, points)[:, 1], np.where(greater, expected[1], expected[0]))
    cut = -parts[1](points) > parts[0](points)
    for smooth in (0, 0.05):
        less = literal([Implicit(subtraction(*parts, smooth=smooth))])
        expected = [less.materials.index(m) for m in (RED, BLUE)]
        np.testing.assert_array_equal(evaluate(gpu, less, points)[:, 1], np.where(cut, expected[1], expected[0]))
    plain = sphere(0.6).at(1)
    both = union(sphere(1.2).material(BLUE), plain)
    bare = literal([Implicit(subtraction(parts[0], both), material=BLUE)])
    found = evaluate(gpu, bare, points)[:, 1] == bare.materials.index(BLUE)
    inner = (-both(points) > parts[0](points)) & (sphere(1.2)(points) < plain(points))
    np.testing.assert_array_equal(found, inner)
    less = literal([Implicit(subtraction(parts[0], sphere(1.2)), material=BLUE)])
    assert less.materials == (RED,)


def body(code: Literal) -> list[str]:
    lines = code.text.splitlines()
    start = lines.index("fn scene_distance(p: vec3f) -> f32 {")
    return [line.strip() for line in lines[start + 1 : lines.index("}", start)]]


def test_transforms_cost_what_they_must() -> None:
    """No product for what only moves, none for a chain, one for a turn that several leaves share."""

    def written(shape: Shape) -> str:
        return " ".join(body(literal([Implicit(shape)])))

    assert "mat3x3f" not in written(sphere().at(1, 2, 3).at(0, 0, 1))
    assert "p - vec3f(1.0, 2.0, 4.0)" in written(sphere().at(1, 2, 3).at(0, 0, 1))
    assert "vec3f(-p.z, p.y, p.x)" in written(box().orient((1, 0, 0)))
    assert "mat3x3f" not in written(box().rotate(0.3))
    assert written(box().rotate(0.3, (1, 1, 1)).named("a").rotate(0.2, (0, 1, 1))).count("mat3x3f") == 1
    several = union(*(box().at(x) for x in range(4))).rotate(0.3, (1, 1, 1))
    assert written(several).count("mat3x3f") == 1
    assert "* d" not in written(sphere().rotate(0.3, (1, 1, 1)).scale(2).scale(0.5))
    assert written(sphere().scale(2)).endswith("return 2.0 * d1;")


def test_a_place_that_several_ask_at_is_computed_once() -> None:
    shape = union(sphere(0.5).at(1), box(0.5).at(1), Round(sphere(0.1).at(1), 0.2))
    assert len([line for line in body(literal([Implicit(shape)])) if line.startswith("let p")]) == 1


def test_numbers_are_float32_by_their_fewest_digits() -> None:
    assert [number(x) for x in (0.1, 1, -2.5, 1e-7, 3e12)] == ["0.1", "1.0", "-2.5", "1e-07", "3e+12"]
    with pytest.raises(ParameterError, match="cannot be written"):
        number(float("inf"))
    assert moved("q", np.diag([2.0, 2, 2, 1])) == "2.0 * q"


def test_what_has_no_code_is_refused() -> None:
    class Odd(Shape):
        def extent(self, level: float) -> tuple[Floats, Floats]:
            return np.zeros(3), np.zeros(3)

    with pytest.raises(ParameterError, match="Odd has no literal code"):
        literal([Implicit(Odd())])
    with pytest.raises(ParameterError, match="none are given"):
        literal([])
    assert isinstance(Combination((sphere(),)).shapes[0], Primitive)


def sequential(shapes: list[Shape], smooth: float, blend: str, points: Floats) -> Floats:
    """A smooth union from the first to the last."""
    pair = Combination((sphere(), sphere()), "union", smooth, blend)  # type: ignore[arg-type]
    value = shapes[0](points)
    for shape in shapes[1:]:
        value = pair._least(value, shape(points))
    return value


@pytest.mark.parametrize("blend", BLENDS)
@pytest.mark.parametrize("layout", ["bare", "placed", "turned"])
def test_a_list_is_looped_over(gpu: Gpu, layout: str, blend: str) -> None:
    rng = np.random.default_rng(5)
    leaves: list[Shape] = []
    for i in range(20):
        leaf: Shape = sphere(rng.uniform(0.1, 0.4))
        if layout != "bare":
            leaf = (leaf if i % 3 else box(tuple(rng.uniform(0.1, 0.6, 3)))).material(RED if i % 2 else BLUE)
        if layout == "turned":
            leaf = leaf.rotate(rng.uniform(0, 6), tuple(rng.normal(size=3))).scale(rng.uniform(0.5, 2))
        leaves.append(leaf.named("all").at(*rng.uniform(-1.5, 1.5, 3)))
    shape = union(*leaves, smooth=0.15, blend=blend)  # type: ignore[arg-type]
    code = literal([Implicit(shape.at(0.1)), Implicit(box(1).at(0, 0, 2))], loops=[0])
    assert code.lists[0].layout == layout
    points = some_points(2000)
    inside = points - (0.1, 0, 0)
    other = box(1).at(0, 0, 2)(points)
    found = evaluate(gpu, code, points)
    expected = np.minimum(sequential(leaves, 0.15, blend, inside), other)
    np.testing.assert_allclose(found[:, 0], expected, rtol=2e-5, atol=2e-5)
    if layout != "bare":
        nearest = np.array([leaf(inside) for leaf in leaves]).argmin(axis=0)
        listed = sequential(leaves, 0.15, blend, inside) < other
        colors = [code.materials.index(RED if i % 2 else BLUE) for i in range(20)]
        assert (found[listed, 1] == np.array(colors)[nearest][listed]).mean() > 0.999
    moves = rng.uniform(-0.5, 0.5, (20, 3))
    moved_leaves = [leaf.at(*by) for leaf, by in zip(leaves, moves, strict=True)]
    found = evaluate(gpu, code, points, {"all": moves})
    expected = np.minimum(sequential(moved_leaves, 0.15, blend, inside), other)
    np.testing.assert_allclose(found[:, 0], expected, rtol=2e-5, atol=2e-5)


def test_what_is_no_list_is_not_looped_over() -> None:
    odd = union(sphere(), box() - sphere())
    with pytest.raises(ParameterError, match="no union of leaves alone"):
        literal([Implicit(odd)], loops=[0])
    with pytest.raises(ParameterError, match="no union of leaves alone"):
        literal([Implicit(sphere())], loops=[0])
    code = literal([Implicit(union(sphere().named("a"), sphere().at(1)))], loops=[0])
    with pytest.raises(ParameterError, match="no directions"):
        code.rows({"a": rotation(1, (0, 0, 1))})
    with pytest.raises(ParameterError, match=r"\(2, 2\) is not"):
        code.rows({"a": np.zeros((2, 2))})


def test_every_kind_of_node_has_code(gpu: Gpu) -> None:
    """One of each primitive and modifier, side by side in one scene a batch, held against float64."""
    kinds = [*SOLIDS.values(), *PROFILES.values()]
    shapes: list[Shape] = [cls() if cls.dimension == 3 else cls().extrude(0.4) for cls in kinds]
    lump = union(sphere(0.4).at(0.3), box((0.3, 0.5, 0.2)), smooth=0.1)
    shapes += [
        lump.twist(0.4), lump.bend(0.2), lump.shell(0.05), lump.round(0.1), lump.mirror("xy"), lump.displace(0.02, 0.7),
        lump.noise(0.02, 0.3), lump.repeat(2.5), lump.repeat((3, 3, 0), mirrored=True), lump.elongate(0.3, 0.1),
        PROFILES["circle"]().revolve(1.0),
    ]  # fmt: skip
    points = some_points(300, 1.5)
    for batch in range(0, len(shapes), 20):
        chosen = shapes[batch : batch + 20]
        expected = np.min([shape(points) for shape in chosen], axis=0)
        found = evaluate(gpu, literal([Implicit(shape) for shape in chosen]), points)[:, 0]
        np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("shape", [sphere(0.3), union(sphere(0.2), sphere(0.1).at(0.25, 0.1, 0.05))])
def test_what_is_repeated_is_written_once_or_twice_an_axis(gpu: Gpu, shape: Shape) -> None:
    one = shape.count == 1
    row = shape.repeat((0.8, 0.9, 1.0), (5, 1, 2)).at(0.1)
    ring = shape.at(1.2, 0, 0.2).polar(9, (0, 1, 0))
    points = some_points(2000)
    for repeated, calls in ((row, 1 if one else 8), (ring, 1 if one else 4)):
        code = literal([Implicit(repeated)])
        assert sum("solids_sphere(" in line for line in body(code)) == calls
        np.testing.assert_allclose(evaluate(gpu, code, points)[:, 0], repeated(points), rtol=2e-5, atol=2e-5)


def test_what_reaches_far_is_written_as_its_copies(gpu: Gpu) -> None:
    wide, points = sphere(1.5).repeat((1, 1, 1), (3, 1, 1)), some_points(500)
    code = literal([Implicit(wide)])
    assert sum("solids_sphere(" in line for line in body(code)) == 3
    np.testing.assert_allclose(evaluate(gpu, code, points)[:, 0], wide(points), rtol=2e-5, atol=2e-5)
