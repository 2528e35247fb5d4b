"""What a compiled program is made of: its order, its stacks, its joins, its parts and its materials."""

from __future__ import annotations

import numpy as np
import pytest

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Material
from tyndall.sdf import Shape, box, circle, intersection, sphere, subtraction, torus, union
from tyndall.sdf.program import (
    BORROWS,
    COMBINE,
    ENTER,
    HARD,
    INTERSECT,
    LEAF,
    NEGATE,
    PLACED,
    POLYNOMIAL,
    PUSH,
    SUBTRACT,
    TURNED,
    UNION,
    Kinds,
    Program,
    compile_shape,
)
from tyndall.sdf.shape import rotation


def compiled(shape: Shape) -> Program:
    return compile_shape(shape, Kinds())


def kinds_of(program: Program) -> list[tuple[int, int]]:
    """(type, join) of each instruction."""
    return [(word >> 16 & 0xF, word >> 20 & 0xF) for word in program.words[:, 0].tolist()]


def run_stacks(program: Program) -> tuple[int, int]:
    """The deepest stacks of values and of places, by following the program; one value must be left."""
    values = places = deepest = most = 0
    for word, (kind, join) in zip(program.words[:, 0].tolist(), kinds_of(program), strict=True):
        if kind == LEAF:
            values += join == PUSH
            assert values > 0
        elif kind == COMBINE:
            values -= 1
        elif word & PLACED:
            places += 1 if kind == ENTER else -1
        assert values >= 0
        assert places >= 0
        deepest, most = max(deepest, values), max(most, places)
    assert (values, places) == (1, 0)
    return deepest, most


def test_a_leaf_joins_what_is_before_it() -> None:
    """So a long union needs no stack; a smooth one, which joins by pairs, a shallow one."""
    balls = [sphere().at(float(i)) for i in range(100)]
    program = compiled(union(*balls))
    assert kinds_of(program) == [(LEAF, PUSH), *[(LEAF, UNION)] * 99]
    assert (program.words[:, 0] >> 24 & 3 == HARD).all()
    assert run_stacks(program)[0] == 1
    program = compiled(union(*balls, smooth=0.1))
    joins = program.words[[join != PUSH for _, join in kinds_of(program)], 0]
    assert len(joins) == 99
    assert (joins >> 24 & 3 == POLYNOMIAL).all()
    assert run_stacks(program)[0] <= 7  # log₂ 100


def test_each_operation_has_its_join() -> None:
    a, b, c = sphere(), box(), torus()
    assert kinds_of(compiled(a | b)) == [(LEAF, PUSH), (LEAF, UNION)]
    assert kinds_of(compiled(a & b)) == [(LEAF, PUSH), (LEAF, INTERSECT)]
    assert kinds_of(compiled(a - b)) == [(LEAF, PUSH), (LEAF, SUBTRACT)]
    assert kinds_of(compiled(a - (b & c))) == [(LEAF, PUSH), (LEAF, PUSH), (LEAF, INTERSECT), (COMBINE, SUBTRACT)]
    assert not (compiled(a - b).words[:, 0] & NEGATE).any(), "that is for what pruning leaves"
    assert (compiled(a | b).words[:, 0] >> 24 & 3 == HARD).all()


@pytest.mark.parametrize(
    "shape",
    [
        sphere(),
        (sphere() | box()) - (torus() & (box() - sphere().at(1))),
        union(*(box() - sphere(i / 9) for i in range(1, 9))),
        (sphere() | (box() - torus()).named("part").rotate(1)).twist(0.5).shell(0.1) | torus().bend(0.3),
        (box() - sphere()).repeat((3, 0, 0)) & box((9, 2, 2)),
    ],
)
def test_a_program_leaves_one_value(shape: Shape) -> None:
    """And says how much room it takes."""
    program = compiled(shape)
    deepest, most = run_stacks(program)
    assert program.values >= deepest
    assert program.values <= deepest + 1
    assert most <= program.places <= most + 1
    assert program.words[:, 1].max() < len(program.slots)
    assert program.lipschitz == shape.lipschitz


def test_spans_are_where_joined_values_begin() -> None:
    program = compiled((sphere() | box()) - (torus() & (box() - sphere().at(1))))
    for i, (kind, join) in enumerate(kinds_of(program)):
        first, second = program.spans[i].tolist()
        if kind == LEAF and join != PUSH:
            assert second == i
        if kind == COMBINE:
            assert first < second < i
            assert kinds_of(program)[second] == (LEAF, PUSH)
    assert program.spans[-1].tolist()[0] == 0


def test_transforms_are_in_the_leaves() -> None:
    """Moved ones are moved; turned ones have three rows more, and say so."""
    program = compiled(sphere().at(1, 2, 3) | box().rotate(0.5).scale(2).at(4))
    moved, turned = program.words.tolist()
    np.testing.assert_allclose(program.slots[moved[1]], (1, 2, 3, 1))
    assert not moved[0] & TURNED
    assert turned[0] & TURNED
    assert program.slots[turned[1], 3] == pytest.approx(2)
    inverse = np.linalg.inv(program.leaves[1].placement)
    np.testing.assert_allclose(program.slots[turned[1] + 4 : turned[1] + 7], inverse[:3], atol=1e-6)
    assert all(kind == LEAF for kind, _ in kinds_of(program))


def test_parts_are_numbered_and_copies_share_a_number() -> None:
    ball = sphere(0.1).named("ball")
    pair = (ball | ball.at(1)).repeat((3, 0, 0), (4, 1, 1))
    parts = compiled(pair).names["ball"]
    assert sorted(part.number for part in parts) == [0] * 4 + [1] * 4
    for number in (0, 1):
        copies = [(part.before @ part.after)[0, 3] for part in parts if part.number == number]
        np.testing.assert_allclose(sorted(copies), number + np.array([-4.5, -1.5, 1.5, 4.5]))
    assert all(part.leaf >= 0 for part in parts)
    group = (sphere() - box()).named("group").at(1)
    (part,) = compiled(group | torus()).names["group"]
    assert part.leaf == -1
    np.testing.assert_allclose(part.before[:3, 3], (1, 0, 0))


def test_where_a_part_is_placed() -> None:
    """before · motion · after: what is around the name, and what is inside of it."""
    around, inside = rotation(0.4, (1, 2, 3)), rotation(-0.7, (0, 1, 0))
    shape = box().transform(inside).named("part").transform(around) | sphere()
    (part,) = compiled(shape).names["part"]
    leaf = compiled(shape).leaves[part.leaf]
    np.testing.assert_allclose(part.before @ part.after, leaf.placement, atol=1e-12)
    np.testing.assert_allclose(part.before, around, atol=1e-12)


def test_materials_are_numbered_once() -> None:
    red, blue = Material("red"), Material("blue")
    program = compiled(union(sphere().material(red), box().material(blue), torus().material(red), sphere(2)))
    assert program.materials == [red, blue]
    assert program.slots[program.material_rows, 2].tolist() == [0, 1, 0, -1]


def test_what_cuts_keeps_the_material_of_what_is_cut() -> None:
    program = compiled(sphere().material(Material("red")) - box())
    assert [bool(word & BORROWS) for word in program.words[:, 0].tolist()] == [False, True]


def test_margins() -> None:
    """Of unions alone: the sum of the widths above, or as much as can matter; none where anything else is above a
    leaf.
    """

    def margins(shape: Shape) -> list[float]:
        program = compiled(shape)
        return [float(program.slots[leaf.slot + 3, 3]) for leaf in program.leaves]

    assert margins(union(sphere(), union(box(), torus(), smooth=0.5), smooth=0.25)) == [0.25, 0.75, 0.75]
    assert margins(union(*(sphere(i) for i in range(1, 1025)), smooth=0.5)) == pytest.approx([3.51] * 1024)
    assert margins(union(sphere(), box(), smooth=0.25, blend="exponential")) == [6.25, 6.25]
    assert margins(sphere() - box()) == [-1, -1]


def test_a_leaf_above_its_margin_changes_nothing() -> None:
    """The worst of leaves with equal shares at each of n unions, against what is left of it at the top."""
    k, change = 0.5, 1e-8
    for n in (1, 4, 15, 40):
        share = change ** (1 / (n + 1))  # the leaf's own union has it twice
        above = n * k * (1 - share) ** 2
        assert above <= 7.02 * k
        rest = np.zeros(n)  # values beside it, lowest at the top
        value = above
        for i in range(n):
            rest[i] = value - k * (1 - 2 * share)
            value -= k * (1 - share) ** 2
        with_it, without = above, rest[0]
        for i in range(n):
            with_it = smooth_least(with_it, rest[i], k)
            without = smooth_least(without, rest[i], k) if i else without
        assert with_it == pytest.approx(0, abs=1e-12)
        assert 0.5 * change * k < without - with_it < 1.001 * change * k


def smooth_least(a: float, b: float, k: float) -> float:
    return min(a, b) - 0.25 * k * (max(k - abs(a - b), 0) / k) ** 2


def test_sags() -> None:
    """How far the whole is below its least leaf: a quarter of each polynomial width, all of an exponential one."""
    assert compiled(sphere() | box()).sag == 0
    assert compiled(union(sphere(), box(), smooth=0.25)).sag == 0.0625
    assert compiled(union(sphere(), box(), smooth=0.25, blend="exponential")).sag == 0.25
    assert compiled(sphere() & box()).sag == -1
    assert compiled(sphere() - box()).sag == -1
    assert compiled((sphere() | box()).shell(0.1)).sag == -1


def test_kinds_are_numbered_as_they_come() -> None:
    kinds = Kinds()
    compile_shape(sphere() | box(), kinds)
    assert kinds.version == 2
    compile_shape(box() | sphere(), kinds)
    assert kinds.version == 2
    compile_shape(intersection(torus(), subtraction(box(), sphere())), kinds)
    assert kinds.version == 3
    assert kinds.is_trusted
    assert [kinds.of(shape) for shape in (sphere(3), box(2), torus())] == [0, 1, 2]


def test_kinds_keep_the_numbers_of_others() -> None:
    """The same set is the same text in whatever order; whether all are in use is known."""
    first = Kinds()
    compile_shape(sphere() | box().twist(0.1), first)
    same = Kinds(first)
    assert not same.is_tight
    compile_shape(box() | sphere().twist(0.3), same)
    assert same.is_tight
    assert (same.version, same.wesl()) == (first.version, first.wesl())
    fewer = Kinds(first)
    program = compile_shape(torus() | (box() & torus()).twist(0.2), fewer)
    assert not fewer.is_tight
    tight, (renumbered,) = fewer.tightened([program])
    assert tight.is_tight
    assert [tight.of(shape) for shape in (box(), torus())] == [0, 1]
    alone = Kinds()
    compile_shape(box(), alone)
    np.testing.assert_array_equal(renumbered.words, compile_shape(torus() | (box() & torus()).twist(0.2), alone).words)
    again = Kinds(tight)
    again.ask(renumbered)
    assert again.is_tight
    compile_shape(torus(), same)
    assert (same.version, first.version) == (4, 3), "the others are as they were"


def test_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParameterError, match="Circle is flat; extrude or revolve it"):
        compiled(circle())
    monkeypatch.setattr("tyndall.sdf.program._MOST_NODES", 2)
    with pytest.raises(ParameterError, match="3 nodes; 2 are the most"):
        compiled(sphere() | box())
