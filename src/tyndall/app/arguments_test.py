from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pytest

from tyndall.app.arguments import convert_flags, parse_size, split_flags, split_list
from tyndall.gpu.params import ParameterError, param


@dataclass(frozen=True)
class Fog:
    grid: tuple[int, int, int] = param((4, 4, 4), 1, 64, "cells")
    g: float = param(0.0, -0.99, 0.99, "mean cosine")
    model: Literal["paper", "physical"] = param("physical", doc="equations")


MEMBERS: dict[str, type] = {"fog": Fog, "off": type("Off", (), {"__dataclass_fields__": {}})}


def test_flags_are_separated_wherever_they_stand() -> None:
    words = ["render", "--fog.g", "-0.5", "box", "--fog.grid=1,2,3", "--size", "4x4"]
    assert split_flags(words) == (
        ["render", "box", "--size", "4x4"],
        [("fog", "g", "-0.5"), ("fog", "grid", "1,2,3")],
    )


def test_a_file_name_with_dots_is_no_flag() -> None:
    assert split_flags(["render", "a.b.glb", "./--x.y"]) == (["render", "a.b.glb", "./--x.y"], [])


@pytest.mark.parametrize("words", [["--fog.g"], ["--fog.g", "--json"]])
def test_a_flag_needs_its_value(words: list[str]) -> None:
    with pytest.raises(ParameterError, match=r"^--fog\.g: needs a value$"):
        split_flags(words)


def test_values_have_the_declared_types() -> None:
    flags = [("fog", "grid", "1,2,3"), ("fog", "g", "0.5"), ("fog", "model", "paper"), ("fog", "g", "-0.25")]
    assert convert_flags(flags, MEMBERS) == {"fog": {"grid": (1, 2, 3), "g": -0.25, "model": "paper"}}


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        (("fgo", "g", "1"), "--fgo.g: no technique 'fgo' — did you mean 'fog'?"),
        (("fog", "gird", "1"), "--fog.gird: 'fog' has no parameter 'gird' — did you mean 'grid'?"),
        (("fog", "zzz", "1"), "--fog.zzz: 'fog' has no parameter 'zzz'; it has grid, g, model"),
        (("off", "g", "1"), "--off.g: 'off' has no parameter 'g'; it has none"),
        (("fog", "grid", "1,2"), "--fog.grid: '1,2' is not 3 whole numbers"),
        (("fog", "grid", "1,2,99"), "--fog.grid: 99 is outside 1 … 64"),
        (("fog", "g", "nan"), "--fog.g: nan is not a finite number"),
        (("fog", "model", "papre"), "--fog.model: 'papre' is not one of 'paper', 'physical' — did you mean 'paper'?"),
    ],
)
def test_a_wrong_flag_is_named_with_the_nearest_right_one(flag: tuple[str, str, str], message: str) -> None:
    with pytest.raises(ParameterError) as error:
        convert_flags([flag], MEMBERS)
    assert str(error.value) == message


@pytest.mark.parametrize(("text", "size"), [("640x360", (640, 360)), (" 1 x 2 ", (1, 2)), ("12×34", (12, 34))])
def test_a_size_is_width_and_height(text: str, size: tuple[int, int]) -> None:
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["640", "640x", "axb", "640x360x3", "6.5x3", "", "0x360", "640x0", "-4x4"])
def test_a_size_that_is_none_says_so(text: str) -> None:
    with pytest.raises(ParameterError, match="^--size: ") as error:
        parse_size(text)
    assert "\n" not in str(error.value)


def test_lists_may_be_repeated_and_separated_by_commas() -> None:
    assert split_list(["off,froxel", "screen-space", "off", ""]) == ["off", "froxel", "screen_space"]
