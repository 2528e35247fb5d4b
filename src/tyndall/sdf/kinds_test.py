"""Every primitive in one program: the device tells a hundred kinds apart, as many as it may be asked for."""

from __future__ import annotations

import numpy as np
import props

from tyndall import sdf
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Implicit
from tyndall.sdf.field import Field
from tyndall.sdf.profiles import PROFILES
from tyndall.sdf.program import _switch
from tyndall.sdf.solids import SOLIDS

VALUE = """
    import package::bindings::implicit_objects;
    import package::sdf::objects::bound_at;
    fn evaluate(x: vec4f) -> vec4f { return vec4f(bound_at(implicit_objects[0], x.xyz).value); }
"""


def test_all_primitives_are_told_apart(gpu: Gpu) -> None:
    """Each of them in its own place, cut out of the others' by a box, so that a wrong one shows."""
    shapes = [cls() for cls in SOLIDS.values()] + [cls().extrude(0.5) for cls in PROFILES.values()]
    placed = [(sdf.box(1.8) & shape).at(3.0 * (i % 8), 3.0 * (i // 8)) for i, shape in enumerate(shapes)]
    whole = sdf.union(*placed)
    rng = np.random.default_rng(0)
    at = np.concatenate([rng.uniform(-1, 1, (40, 3)) + [3.0 * (i % 8), 3.0 * (i // 8), 0] for i in range(len(shapes))])
    at = at.astype(np.float32)
    with Field(gpu, [Implicit(whole)], pruning=False) as field:
        field.update()
        inputs = np.concatenate([at, np.zeros((len(at), 1), np.float32)], axis=1)
        got = props.evaluate(gpu, "test_kinds", VALUE, inputs, scope=field.bindings)[:, 0]
    np.testing.assert_allclose(got, whole(at), atol=2e-5)
    assert len(shapes) > 60


def test_a_hundred_kinds_are_told_apart(gpu: Gpu) -> None:
    """More than a nest of branches may be deep; with a gap in the numbers, as modifiers that only enter leave."""
    cases = [(code, f"{float(code)} + p.x") for code in range(101) if code not in (31, 40)]
    text = _switch("many(code: u32, p: vec3f, at: u32) -> f32", cases, "-1.0")
    rows = np.zeros((103, 4), np.float32)
    rows[:, 0], rows[:, 1] = np.arange(103), 0.25
    evaluate = "fn evaluate(x: vec4f) -> vec4f { return vec4f(many(u32(x.x), x.yzw, 0u)); }"
    got = props.evaluate(gpu, "test_many_kinds", f"{text}\n{evaluate}", rows)[:, 0]
    wanted = np.arange(103) + 0.25
    wanted[[31, 40, 101, 102]] = -1
    np.testing.assert_array_equal(got, wanted)


def test_what_is_repeated_for_ever_is_pruned_as_a_whole(gpu: Gpu) -> None:
    """A copy reaches through its cell's wall, at which the two copies that are asked for change places."""
    shape = sdf.sphere(0.3).at(0.3).repeat((0.9, 0, 0)) & sdf.box((2.7, 0.6, 0.6))
    rng = np.random.default_rng(0)
    wall = np.array([0.45, 0, 0]) + rng.normal(size=(600, 3)) * [0.02, 1, 1]  # A's sphere goes through x = 0.45
    around = wall[:, 1:] / np.linalg.norm(wall[:, 1:], axis=1)[:, None]
    reach = np.sqrt(0.3**2 - (wall[:, :1] - 0.3) ** 2)
    at = np.concatenate([wall[:, :1], around * (reach + rng.normal(0, 0.004, reach.shape))], axis=1).astype(np.float32)
    with Field(gpu, [Implicit(shape)]) as field:
        field.update()
        inputs = np.concatenate([at, np.zeros((len(at), 1), np.float32)], axis=1)
        got = props.evaluate(gpu, "test_forever", VALUE, inputs, scope=field.bindings)[:, 0]
    np.testing.assert_allclose(got, shape(at), atol=1e-5)
