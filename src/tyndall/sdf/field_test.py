"""Cells say what whole programs say, and those what the shapes say: at rest, after motion, and where nothing fits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import props
import pytest
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.lab import field_check
from tyndall.scene.model import Implicit, translations
from tyndall.sdf import Grid, Shape, box, circle, cylinder, intersection, rectangle, sphere, subtraction, torus, union
from tyndall.sdf.field import Field
from tyndall.sdf.marching import Marching
from tyndall.sdf.shape import Blend, rotation

# Objects are long and thin: their cells are few, and as small beside their parts as those of a thick one.
BLENDS: tuple[Blend, ...] = ("polynomial", "exponential", "root")


def leaf(rng: np.random.Generator) -> Shape:
    kind = rng.integers(3)
    size = rng.uniform(0.15, 0.3)
    made: Shape = sphere(size) if kind == 0 else box((size, 1.2 * size, 1.5 * size)) if kind == 1 else torus(size, 0.06)
    turned = made.rotate(rng.uniform(0, 6), rng.normal(size=3).tolist()) if rng.random() < 0.5 else made
    x, y, z = rng.uniform((-2, -0.3, -0.3), (2, 0.3, 0.3))
    return turned.at(x, y, z)


def tree(rng: np.random.Generator, leaves: int, depth: int = 0) -> Shape:
    """Any operation above any other, hard or with any blend; more unions than others, so that something is left."""
    if leaves == 1:
        return leaf(rng)
    left = int(rng.integers(1, leaves))
    a, b = tree(rng, left, depth + 1), tree(rng, leaves - left, depth + 1)
    smooth, blend = float(rng.choice((0.0, 0.08))), BLENDS[rng.integers(3)]
    chosen = 0 if depth < 2 else rng.integers(6)
    if chosen < 4:
        return union(a, b, smooth=smooth, blend=blend)
    if chosen == 4:
        return subtraction(a, b, smooth=smooth, blend=blend)
    return intersection(union(a, b), box((1.5, 1, 1)).at(*rng.uniform((-1, -0.2, -0.2), (1, 0.2, 0.2))), smooth=smooth)


def shapes() -> dict[str, Shape]:
    rng = np.random.default_rng(7)
    bead = sphere(0.12).at(0.1).named("bead") | box(0.14).at(-0.1)
    wave = sphere(0.3).at(0.3).repeat((0.9, 0, 0)) & box((2.7, 0.6, 0.6))
    return {
        "nest": tree(rng, 32),
        **{blend: union(*(leaf(rng) for _ in range(16)), smooth=0.1, blend=blend) for blend in BLENDS},
        "balls": union(
            *(sphere(0.05).at(*rng.uniform((-2, -0.4, -0.4), (2, 0.4, 0.4))).named("ball") for _ in range(520))
        ),
        "copies": bead.repeat((0.7, 0.5, 0), (5, 2, 1)),
        "forever": union(wave, sphere(0.2).at(0, 0.4), torus(0.3, 0.1).at(1), box(0.2).at(-1, 0.3)),
    }


SHAPES = shapes()
NAMES = list(SHAPES)
IMPLICITS = [Implicit(shape) for shape in SHAPES.values()]


@pytest.fixture(scope="module")
def field(gpu: Gpu) -> Iterator[Field]:
    with Field(gpu, IMPLICITS) as made:
        yield made


def places(shape: Shape, count: int, seed: int = 0) -> NDArray[np.float32]:
    low, high = shape.box
    return np.random.default_rng(seed).uniform(low, high, (count, 3)).astype(np.float32)


def agree(gpu: Gpu, field: Field, index: int, shape: Shape, count: int = 4000, *, oracle: int = 4000) -> float:
    """Cells' programs, whole programs and numpy say one thing, and rays are told no more than that.

    Returns:
        the part of the places whose cells have programs.
    """
    points = places(shape, count)
    whole, cell, has, told = field_check.values(gpu, field, index, points).astype(float).T
    np.testing.assert_allclose(whole[:oracle], shape(points[:oracle]), atol=2e-5)
    near = has > 0
    np.testing.assert_allclose(cell[near], whole[near], atol=1e-5)
    assert (np.abs(told) <= np.abs(whole) + 1e-5).all()
    assert ((told * whole >= 0) | (np.abs(told - whole) < 1e-5)).all()
    return float(near.mean())


# --- at rest ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_cells_say_what_the_shape_says(gpu: Gpu, field: Field, name: str) -> None:
    near = agree(gpu, field, NAMES.index(name), SHAPES[name])
    assert 0.02 < near < 0.98


def test_a_million_places(gpu: Gpu, field: Field) -> None:
    """A program of sixty nodes and more, by all its cells and as a whole."""
    assert SHAPES["nest"].count > 60
    agree(gpu, field, NAMES.index("nest"), SHAPES["nest"], 1_000_000, oracle=20_000)


def test_lists_are_short(gpu: Gpu, field: Field) -> None:
    """Of 520 balls a cell near the surface keeps a few: less than four a cell, all lists together."""
    field.update()
    used, overflows = field.counters()[NAMES.index("balls")]
    assert 0 < used < 4 * 64**3 / 4
    assert overflows == 0


# --- where nothing fits -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("constants", "overflows"),
    [
        ({"_LEAST_ENTRIES": 64, "_MOST_ENTRIES": 64}, True),
        ({"_LEAST_ENTRIES": 3000, "_MOST_ENTRIES": 3000}, True),
        ({"_MOST_MARKS": 64, "_LONG": 1 << 20}, True),
        ({"_EIGHTHS": (0, 0, 0)}, False),
        ({"_EIGHTHS": (64, 64, 64)}, False),
        ({"_LONG": 20}, False),
        ({"_LONG": 20, "_LEAST_ENTRIES": 3000, "_MOST_ENTRIES": 3000}, True),
    ],
    ids=["no-lists", "few-lists", "no-marks", "no-eighths", "few-eighths", "long", "long-few-lists"],
)
def test_other_ways_say_the_same(
    gpu: Gpu, monkeypatch: pytest.MonkeyPatch, constants: dict[str, int], overflows: bool
) -> None:
    """Lists, marks or eighths that do not fit make cells slower, not wrong; nor does sorting out leaves first."""
    for name, value in constants.items():
        monkeypatch.setattr(f"tyndall.sdf.field.{name}", value)
    with Field(gpu, IMPLICITS) as field:
        for index, name in enumerate(NAMES):
            agree(gpu, field, index, SHAPES[name], 1500, oracle=300)
        assert (field.counters()[:, 1] > 0).any() == overflows


def test_objects_share_what_room_there_is(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond what a shader sees of a buffer, some have fewer cells and shorter lists; what needs more is refused."""
    monkeypatch.setattr(gpu, "part_bytes", 6 << 20)
    with Field(gpu, IMPLICITS) as field:
        assert all(buffer.size_bytes <= 6 << 20 for buffer in field.resources())
        assert sorted({made.levels for made in field._objects}) == [1, 2]
        for index, name in enumerate(NAMES):
            agree(gpu, field, index, SHAPES[name], 1500, oracle=300)
    monkeypatch.setattr(gpu, "part_bytes", 4096)
    with pytest.raises(GpuError, match="shaders of this adapter see 4,096"):
        Field(gpu, IMPLICITS)


def test_nothing_is_inside(gpu: Gpu) -> None:
    shape = intersection(*(sphere(0.1).at(*at) for at in ((0, 0, 0), (5, 5, 5), (0, 5, 0), (5, 0, 0), (0, 0, 5))))
    with Field(gpu, [Implicit(shape)]) as field:
        whole, _, _, told = field_check.values(gpu, field, 0, np.zeros((1, 3))).T
        assert told > 0
        np.testing.assert_allclose(whole, shape(np.zeros((1, 3))), rtol=1e-5)


def test_pruning_that_was_never_submitted_is_done_again(gpu: Gpu) -> None:
    index = NAMES.index("nest")
    with Field(gpu, [IMPLICITS[index]]) as field:
        field.update()
        gpu.discard()
        field.forget()
        agree(gpu, field, 0, SHAPES["nest"], 1000)


def test_without_cells(gpu: Gpu) -> None:
    with Field(gpu, IMPLICITS, pruning=False) as field:
        for index, name in enumerate(NAMES):
            assert agree(gpu, field, index, SHAPES[name], 1000) == 1


# --- motion -------------------------------------------------------------------------------------------------------


def moved(shape: Shape, name: str, given: NDArray[np.float64]) -> Shape:
    matrices = np.tile(np.eye(4), (len(given), 1, 1))
    if given.ndim == 2:
        matrices[:, :3, 3] = given
    else:
        matrices = given
    return shape.moved({name: iter(matrices)})


def turns(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    made = np.stack([rotation(angle, rng.normal(size=3).tolist()) for angle in rng.uniform(-1, 1, count)])
    made[:, :3, 3] = rng.uniform(-0.1, 0.1, (count, 3))
    return made


@pytest.mark.parametrize(("name", "part", "count"), [("balls", "ball", 520), ("copies", "bead", 1)])
@pytest.mark.parametrize("turned", [False, True])
def test_moved_parts_are_where_they_were_moved(
    gpu: Gpu, field: Field, name: str, part: str, count: int, turned: bool
) -> None:
    """Also those outside of the object's old box; copies of a part move together."""
    rng = np.random.default_rng(3)
    for given in (turns(count, rng) if turned else rng.normal(0, 0.2, (count, 3)), np.zeros((count, 3))):
        field.move(part, given)
        agree(gpu, field, NAMES.index(name), moved(SHAPES[name], part, given))


def test_what_was_smaller_and_is_only_moved_has_its_size_again(gpu: Gpu, field: Field) -> None:
    """Also where the frame that was to show it failed, and after turns that came before what was sent last."""
    count, index = 520, NAMES.index("balls")
    ways, turned = np.random.default_rng(4).normal(0, 0.1, (count, 3)), turns(count, np.random.default_rng(6))
    field.move("ball", np.diag([0.5, 0.5, 0.5, 1.0])[None].repeat(count, 0))
    field.move("ball", ways)
    field.update()
    gpu.discard()
    field.forget()
    agree(gpu, field, index, moved(SHAPES["balls"], "ball", ways), 1000)
    field.move("ball", 2 * ways)
    field.move("ball", turned)
    agree(gpu, field, index, moved(SHAPES["balls"], "ball", turned), 1000)
    field.move("ball", np.zeros((count, 3)))


def test_several_names_move_as_one_after_another(gpu: Gpu) -> None:
    rng = np.random.default_rng(8)
    pair = sphere(0.1).named("a").at(0.2) | box(0.2).named("b").at(-0.2)
    group = union(torus(0.2, 0.05), sphere(0.1).at(0, 0.2), smooth=0.05).named("c").at(0, 0, 0.3)
    shape = union(pair, group, *(sphere(0.05).at(*rng.uniform(-0.5, 0.5, 3)) for _ in range(6)), smooth=0.05)
    given = {"a": rng.normal(0, 0.1, (1, 3)), "b": turns(1, rng), "c": turns(1, rng)}
    there = shape.moved(
        {name: iter(moves if moves.ndim == 3 else translations(moves)) for name, moves in given.items()}
    )
    with Field(gpu, [Implicit(shape)]) as field:
        field.move_all(given)
        agree(gpu, field, 0, there, 1000)
        with pytest.raises(ParameterError, match="c: a transform that has no inverse"):
            field.move_all({"b": turns(1, rng), "c": np.zeros((1, 4, 4))})


@pytest.mark.parametrize("factor", [0.15, 2.0])
def test_scaled_parts_are_pruned_by_their_new_slopes(gpu: Gpu, factor: float) -> None:
    """Within a part that is made smaller values change faster than where it was compiled, and in parts of it."""
    rng = np.random.default_rng(5)
    balls = union(*(sphere(0.1).at(*rng.uniform(-0.5, 0.5, 3)) for _ in range(8)), smooth=0.1).named("inner")
    inside = union(balls, box(0.3).at(0.5, 0.5)).scale((1, 0.5, 1)).round(0.02).named("outer")
    shape = inside | sphere(0.1).at(0, 0.8)
    scale = np.diag([factor] * 3 + [1.0])[None]
    with Field(gpu, [Implicit(shape)]) as field:
        for name in ("outer", "inner"):
            field.move(name, scale)
        agree(gpu, field, 0, shape.moved({"outer": iter(scale), "inner": iter(scale)}))


def test_a_flat_part_is_moved_within_its_plane(gpu: Gpu) -> None:
    """What is done across the plane changes no distance in it; out of the plane it cannot go."""
    one, two = rectangle((0.3, 0.2)).named("flat"), union(rectangle((0.3, 0.2)), circle(0.1).at(0.2)).named("flat")
    shape = one.rotate(0.4).at(0.3, 0.1).extrude(0.5) | union(two.at(0.4), circle(0.2).at(0.6)).revolve().at(2)
    shallow, wide = np.diag([0.8, 0.6, 0.1, 1]), rotation(0.5, (0, 0, 1)) @ np.diag([1.5, 2.0, 9.0, 1])
    wide[:3, 3] = 0.2, -0.1, 0.3
    with Field(gpu, [Implicit(shape)]) as field:
        for matrix in (shallow, wide):
            given = np.stack([matrix, matrix])
            field.move("flat", given)
            agree(gpu, field, 0, moved(shape, "flat", given), 2000)
        for out, said in ((rotation(0.1, (1, 0, 0)), "out of the plane"), (np.diag([1.0, 1, 0, 1]), "no inverse")):
            with pytest.raises(ParameterError, match=f"flat: .*{said}"):
                field.move("flat", np.stack([np.eye(4), out]))


@pytest.mark.parametrize("size", [0.5, 0.2, 0.05])
def test_a_part_that_shrinks_has_room_for_what_melts(gpu: Gpu, size: float) -> None:
    """What a smooth union adds does not shrink with the part."""
    shape = union(sphere(0.2), sphere(0.2).named("drop"), smooth=1.0)
    move = np.diag([size, size, size, 1.0])[None].copy()
    move[0, 0, 3] = 0.45
    with Field(gpu, [Implicit(shape)]) as field:
        for given in (move, np.eye(4)[None], move):
            field.move("drop", given)
            field.update()
            points = np.random.default_rng(3).uniform(-1, 1, (50_000, 3))
            inside = points[shape.moved({"drop": iter(given)})(points) <= 0]
            low, high = field._objects[0].box
            assert (inside >= low).all()
            assert (inside <= high).all()


def test_an_edit_that_is_wrong_for_one_part_changes_none(gpu: Gpu) -> None:
    shape = union(sphere(0.5).named("part"), box(0.5).at(1).named("part"))
    with Field(gpu, [Implicit(shape)]) as field:
        with pytest.raises(ParameterError, match="part: a Cuboid has no radius"):
            field.edit("part", radius=0.2)
        agree(gpu, field, 0, shape, 1000)
    near = pytest.raises(ParameterError, match="did you mean 'size'")
    with Field(gpu, [Implicit(box(0.5).named("part"))]) as field, near:
        field.edit("part", sizes=0.2)


def test_an_edited_part_below_other_than_unions_has_room(gpu: Gpu) -> None:
    def made(radius: float) -> Shape:
        return subtraction(sphere(radius).named("ball"), *(box(0.1).at(*at) for at in np.eye(3)), box(0.2))

    with Field(gpu, [Implicit(made(0.5))]) as field:
        field.edit("ball", radius=1.5)
        agree(gpu, field, 0, made(1.5))
        assert (field._objects[0].box[1] >= 1.5).all()


def test_an_edited_part(gpu: Gpu, field: Field) -> None:
    was = field.uploaded
    field.edit("bead", radius=0.2)
    assert field.uploaded - was < 2000
    bead = sphere(0.2).at(0.1) | box(0.14).at(-0.1)
    agree(gpu, field, NAMES.index("copies"), bead.repeat((0.7, 0.5, 0), (5, 2, 1)))
    field.edit("bead", radius=0.12)
    agree(gpu, field, NAMES.index("copies"), SHAPES["copies"])


def test_an_edit_prunes_its_object_alone(gpu: Gpu, field: Field) -> None:
    """Pruning counts anew, so what was written into the others' counters is still there."""
    field.update()
    before = gpu.read_buffer(field._counter_buffer).view(np.uint32).copy()
    marked = np.full_like(before, 12345)
    gpu.write(field._counter_buffer, marked)
    field.edit("bead", radius=0.12)
    field.update()
    after = gpu.read_buffer(field._counter_buffer).view(np.uint32).reshape(len(NAMES), -1)
    index = NAMES.index("copies")
    assert (np.delete(after, index, axis=0) == 12345).all()
    assert after[index, 0] == before.reshape(len(NAMES), -1)[index, 0]


def test_an_object_is_placed_by_one_short_write(gpu: Gpu, field: Field) -> None:
    """Its cells are in its own space: nothing is pruned, and it is the same there."""
    field.update()
    was = field.uploaded
    transform = rotation(1.0, (1, 2, 3))
    transform[:3, 3] = (4, 5, 6)
    index = NAMES.index("balls")
    field.place(index, transform)
    assert 0 < field.uploaded - was <= 256
    assert not any(made.dirty for made in field._objects)
    agree(gpu, field, index, SHAPES["balls"], 1000)
    field.place(index, np.eye(4))


def test_what_cannot_be_moved(gpu: Gpu, field: Field) -> None:
    with pytest.raises(ParameterError, match="no part 'bal'.*ball"):
        field.move("bal", np.zeros((1, 3)))
    with pytest.raises(ParameterError, match="520"):
        field.move("ball", np.zeros((2, 3)))
    with pytest.raises(ParameterError, match="not finite"):
        field.move("ball", np.full((520, 3), np.nan))
    with pytest.raises(ParameterError, match="no inverse"):
        field.move("ball", np.zeros((520, 4, 4)))
    with pytest.raises(ParameterError, match="has no width"):
        field.edit("bead", width=1)


def test_samples_cannot_be_edited(gpu: Gpu) -> None:
    """Their place is among a grid's numbers, and its bound follows from them."""
    grid = Grid(
        np.where(np.indices((4, 4, 4)).min(0) * (3 - np.indices((4, 4, 4))).min(0) > 0, -1.0, 1.0), (0, 0, 0), 1.0
    )
    with Field(gpu, [Implicit(grid.named("grid"))]) as field, pytest.raises(ParameterError, match="grid: a Grid with"):
        field.edit("grid", step=0.5)


@pytest.mark.parametrize("kind", ["twist", "bend", "repetition without end"])
def test_what_is_held_where_it_is(gpu: Gpu, kind: str) -> None:
    """The radius of a twist or bend, and the cap of a repetition, are those of the shape at rest."""
    part = union(sphere(0.1).named("part"), box(0.2))
    shape = part.repeat((1, 0, 0)) & box(3) if kind.startswith("rep") else getattr(part, kind)(1.0)
    with Field(gpu, [Implicit(shape)]) as field:
        for change in (lambda: field.move("part", np.ones((1, 3))), lambda: field.edit("part", radius=0.2)):
            with pytest.raises(ParameterError, match=f"part: it is inside of a {kind}"):
                change()


# --- rays ---------------------------------------------------------------------------------------------------------

RAYS = """
    import package::sdf::march::{march_closest, march_occluded};
    fn evaluate(x: vec4f) -> vec4f {
        let direction = normalize(vec3f(1.0, -x.y, 0.0));
        let hit = march_closest(vec3f(-9.0, x.x, 0.0), direction, 0.0, 100.0, 0.0);
        let dark = march_occluded(vec3f(-9.0, x.x, 0.0), direction, 0.0, 100.0);
        return vec4f(hit.t, f32(hit.steps), f32(dark), 0.0);
    }
"""


@pytest.mark.parametrize("steps", [64, 4096])
def test_rays_along_a_surface_end(gpu: Gpu, steps: int) -> None:
    """Where they meet it, or beyond it; and with no more steps than they may take."""
    slab = Implicit(box((20, 0.2, 20)).at(0, -0.1))
    heights = np.array([0.5, 1e-2, 1e-3, 1e-4, 0.5, 0.1, 0.01, 1e-3], np.float32)
    slopes = np.array([0, 0, 0, 0, 0.1, 0.02, 1e-3, 2e-4], np.float32)
    rows = np.stack([heights, slopes, 0 * heights, 0 * heights], axis=1)
    with Field(gpu, [slab], marching=Marching(steps=steps)) as field:
        field.update()
        t, used, dark, _ = props.evaluate(gpu, f"test_grazing_{steps}", RAYS, rows, scope=field.bindings).T
    sure, flat = slopes >= 0.02, slopes == 0
    ends = heights / np.maximum(slopes, 1e-9) * np.hypot(1, slopes)
    np.testing.assert_allclose(t[sure], ends[sure], rtol=2e-2)
    assert (t[flat] > 1e3).all()
    assert ((np.abs(t / ends - 1) < 2e-2) | (t > 1e3)).all(), "flatter ones meet it where it is, or pass"
    assert dark[sure].all()
    assert not dark[flat].any()
    assert (used <= steps + 160).all()


def test_a_field_like_another_has_its_text(gpu: Gpu) -> None:
    """Of the same kinds in another order, and stacks no deeper; else its own, without what it does not need."""
    deep = [Implicit(union(sphere(), box(0.4) - torus(0.5, 0.1)))]

    def slot(implicits: list[Implicit], like: Field | None = None) -> object:
        with Field(gpu, implicits, like=like) as field:
            return field.bindings["implicit_objects"].slot

    with Field(gpu, deep) as first:
        text = first.bindings["implicit_objects"].slot
        flat = union(torus(0.5, 0.1), box(), sphere())
        assert slot([Implicit(flat)], first) == text != slot([Implicit(flat)])
        for other in (sphere(), flat | cylinder(), flat - flat - (flat - flat) - ((flat - flat) - (flat - flat))):
            made = slot([Implicit(other)], first)
            assert made != text
        assert slot([Implicit(sphere())], first) == slot([Implicit(sphere())])
