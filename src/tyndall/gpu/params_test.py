"""Declared parameters: what they accept, what they say when they do not, and their layout on the device."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import props
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tyndall.gpu import params
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, check, fields_of, param, replace
from tyndall.techniques import FAMILIES


@dataclass(frozen=True)
class Everything:
    """A field of every kind, in an order that needs padding."""

    ratio: float = param(0.5, 0, 1, "a ratio")
    color: tuple[float, float, float] = param((1.0, 0.5, 0.25), 0, None, "a colour")
    count: int = param(3, 1, 10, "a count")
    grid: tuple[int, int, int] = param((4, 5, 6), 1, 1024, "a grid", rebuild=True)
    flag: bool = param(True, doc="a switch")
    offset: tuple[float, float] = param((0.5, -0.5), doc="an offset")
    mode: Literal["soft", "hard", "none"] = param("hard", doc="a choice")
    limit: float | None = param(None, 0, None, "stays on the host")
    window: tuple[float, float, float, float] = param((0.0, 0.0, 1.0, 1.0), doc="a window")
    last: float = param(-2.0, doc="a number")

    def __post_init__(self) -> None:
        check(self)


def test_the_layout_is_that_of_the_wesl_struct(gpu: Gpu) -> None:
    """Padding of a vec3 before a scalar, of a vec2, and the size of the struct, by the linker's own reflection."""
    for cls in (Everything, *(cls for family in FAMILIES.values() for cls in family.members.values())):
        name = f"{cls.__name__}Params"
        with props.module(gpu, f"params_{cls.__name__.lower()}", params.struct_wesl(cls, name)) as path:
            reflected = gpu.dtype(f"{path}::{name}")
        ours = params.uniform_dtype(cls)
        if not ours.names:
            assert ours.itemsize == 16
            continue
        assert reflected.fields is not None
        assert ours.fields is not None
        for field in ours.names:
            assert ours.fields[field][1] == reflected.fields[field][1], (cls, field)
            assert ours.fields[field][0].base.kind == reflected.fields[field][0].base.kind, (cls, field)
        assert -(-reflected.itemsize // 16) * 16 == ours.itemsize


def test_a_shader_reads_every_field(gpu: Gpu) -> None:
    uniform = gpu.params("test.params", Everything(), owner="test")
    out = gpu.buffer("test.out", 80, owner="test", element="f32")
    text = """
        import package::bindings::{p, out, EVERYTHING_MODE_HARD};
        @compute @workgroup_size(1)
        fn main() {
            var values = array<f32, 20>(
                p.ratio, p.color.x, p.color.y, p.color.z, f32(p.count), f32(p.grid.x), f32(p.grid.y), f32(p.grid.z),
                f32(p.flag), p.offset.x, p.offset.y, f32(p.mode), f32(p.mode == EVERYTHING_MODE_HARD),
                p.window.x, p.window.y, p.window.z, p.window.w, p.last, 0.0, 0.0);
            for (var i = 0; i < 20; i++) { out[i] = values[i]; }
        }
    """
    with props.module(gpu, "test_everything", text) as path:
        gpu.compute("test", path).bind(p=uniform, out=out.read_write()).dispatch(1)
        got = gpu.read_buffer(out).view(np.float32)
    expected = [0.5, 1, 0.5, 0.25, 3, 4, 5, 6, 1, 0.5, -0.5, 1, 1, 0, 0, 1, 1, -2, 0, 0]
    assert got.tolist() == expected
    uniform.destroy()
    out.destroy()


@pytest.mark.parametrize("text", ["7,8,9", "7x8x9", " 7, 8 ,9"])
def test_several_numbers_in_a_text(text: str) -> None:
    assert params.replace(Everything(), {"grid": text}).grid == (7, 8, 9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ratio": 1.5}, "ratio: 1.5 is outside 0 … 1"),
        ({"ratio": math.nan}, "ratio: nan is not a finite number"),
        ({"ratio": "much"}, "ratio: 'much' is not a number"),
        ({"ratio": True}, "ratio: True is not a number"),
        ({"count": 2.5}, "count: 2.5 is not a whole number"),
        ({"count": "3.0"}, None),
        ({"count": 0}, "count: 0 is outside 1 … 10"),
        ({"grid": "4,5"}, "grid: '4,5' is not 3 whole numbers"),
        ({"grid": (4, 5, 0)}, "grid: 0 is outside 1 … 1024"),
        ({"grid": "7,8,9"}, None),
        ({"color": [1, -0.5, 0]}, "color: -0.5 is outside ≥ 0"),
        ({"color": np.array([1.0, 2.0, 3.0])}, None),
        ({"mode": "sof"}, "mode: 'sof' is not one of 'soft', 'hard', 'none' — did you mean 'soft'?"),
        ({"flag": "true"}, None),
        ({"flag": 1}, "flag: 1 is not true or false"),
        ({"limit": "none"}, None),
        ({"limit": -1}, "limit: -1 is outside ≥ 0"),
        ({"limit": math.inf}, "limit: inf is not a finite number"),
        ({"limit": 1e39}, "limit: 1e+39 is beyond 1e+30"),
        ({"coun": 3}, "coun: no such parameter — did you mean 'count'?"),
        ({"zzz": 3}, "zzz: no such parameter"),
    ],
)
def test_what_is_accepted_and_what_is_said(changes: dict[str, Any], message: str | None) -> None:
    if message is None:
        changed = replace(Everything(), changes)
        (name,) = changes
        assert getattr(changed, name) != getattr(Everything(), name) or changes[name] in ("3.0", "true", "none")
        return
    with pytest.raises(ParameterError) as refused:
        replace(Everything(), changes)
    assert str(refused.value) == message


@given(st.floats(-2, 3) | st.sampled_from([math.nan, math.inf, -math.inf]))
def test_a_range_holds(value: float) -> None:
    if math.isfinite(value) and 0 <= value <= 1:
        assert replace(Everything(), {"ratio": value}).ratio == value
    else:
        with pytest.raises(ParameterError, match=r"^ratio: "):
            replace(Everything(), {"ratio": value})


@given(st.builds(Everything, count=st.integers(1, 10), flag=st.booleans(), mode=st.sampled_from(["soft", "hard"])))
def test_a_command_line_says_the_same(made: Everything) -> None:
    texts = {
        "count": str(made.count),
        "flag": str(made.flag).lower(),
        "mode": made.mode,
        "grid": ",".join(map(str, made.grid)),
    }
    assert replace(Everything(), texts) == made


@pytest.mark.parametrize(
    "cls", [cls for family in FAMILIES.values() for cls in family.members.values()], ids=lambda c: c.name
)
def test_every_technique_declares_all_of_itself(cls: type) -> None:
    declared = {f.name for f in fields_of(cls)}
    assert declared == {f.name for f in dataclasses.fields(cls)}
    for f in fields_of(cls):
        assert f.param.doc, f"{f.name} has no meaning"
        assert not f.param.doc.endswith(".")
    for text in (cls.paper, cls.advice, cls.__doc__):
        assert text
        assert "\n" not in text
    assert cls.advice.endswith(".")


def test_a_choice_of_numbers_may_come_as_text() -> None:
    @dataclass(frozen=True)
    class Rays:
        cones: Literal[1, 7] = param(7, doc="how many")

    assert replace(Rays(), {"cones": "1"}).cones == 1
    with pytest.raises(ParameterError, match="^cones: '3' is not one of 1, 7$"):
        replace(Rays(), {"cones": "3"})
