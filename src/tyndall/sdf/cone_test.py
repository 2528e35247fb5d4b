"""The room around rays: values far from surfaces are the shapes' own, and the least ratio is that of dense samples."""

from __future__ import annotations

import numpy as np
import props

from tyndall.gpu.device import Gpu
from tyndall.scene.model import Implicit
from tyndall.sdf import box, sphere, union
from tyndall.sdf.field import Field

VALUE = """
    import package::sdf::cone::value_near;
    fn evaluate(x: vec4f) -> vec4f {
        return vec4f(value_near(x.xyz, x.w));
    }
"""
ROOM = """
    import package::sdf::cone::{Pace, room};
    fn evaluate(x: vec4f) -> vec4f {
        let way = normalize(vec3f(x.y, x.z, -1.0));
        let found = room(vec3f(x.x, 0.1, 6.0), way, 1e-3, 20.0, x.w, Pace(2e-3 * x.w, 0.02 * x.w, 200));
        return vec4f(found.ratio, found.t, found.slope, 0.0);
    }
"""


def some_shapes() -> tuple[Implicit, ...]:
    """A heap of many balls and blocks, which has cells, and a block beside it that has none."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-1, 1, (60, 3))
    solids = [(sphere(0.12) if i % 2 else box(0.2)).at(*map(float, place)) for i, place in enumerate(places)]
    return Implicit(union(*solids, smooth=0.05)), Implicit(box(0.5).at(2.0, 0, 0))


def distance(implicits: tuple[Implicit, ...], points: np.ndarray) -> np.ndarray:
    return np.min([one.shape(points) for one in implicits], axis=0)  # type: ignore[operator]


def test_values_are_the_shapes_own_near_and_far(gpu: Gpu) -> None:
    implicits = some_shapes()
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (4000, 3))
    with Field(gpu, implicits) as field:
        field.update()
        rows = np.column_stack([points, np.full(len(points), 1e6)])
        got = props.evaluate(gpu, "test_cone_value", VALUE, rows, field.bindings)[:, 0]
    want = distance(implicits, points)
    assert (want > 0.3).sum() > 100  # far from all surfaces as well
    np.testing.assert_allclose(got, want, atol=2e-5)


def test_the_least_ratio_is_that_of_dense_samples(gpu: Gpu) -> None:
    implicits = some_shapes()
    rng = np.random.default_rng(2)
    rows = np.column_stack(
        [
            rng.uniform(-1.5, 2.5, 300),
            rng.uniform(-0.2, 0.2, 300),
            rng.uniform(-0.2, 0.2, 300),
            rng.choice([0.02, 0.2], 300),
        ]
    )
    with Field(gpu, implicits) as field:
        field.update()
        got = props.evaluate(gpu, "test_cone_room", ROOM, rows, field.bindings)[:, 0]
    ways = np.column_stack([rows[:, 1], rows[:, 2], np.full(300, -1.0)])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    origins = np.column_stack([rows[:, 0], np.full(300, 0.1), np.full(300, 6.0)])
    least = np.full(300, np.inf)
    for t in np.linspace(3, 9, 600):
        least = np.minimum(least, distance(implicits, origins + t * ways) / (t * rows[:, 3]))
    want = np.clip(least, 0, 1)
    assert ((want > 0.05) & (want < 0.95)).sum() > 30
    assert (got[want <= 0] == 0).all()
    np.testing.assert_allclose(got, want, atol=0.08)  # low where two things are near by turns
    assert np.abs(got - want).mean() < 0.01
