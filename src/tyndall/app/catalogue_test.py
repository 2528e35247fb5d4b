from __future__ import annotations

from dataclasses import MISSING
from typing import Any

import pytest

from tyndall.app.arguments import convert_flags
from tyndall.app.catalogue import find_techniques, show
from tyndall.gpu.params import ParameterError, fields_of


@pytest.mark.parametrize(
    ("value", "text"),
    [((190, 90, 128), "190,90,128"), (0.5, "0.5"), (True, "true"), (None, "none"), (MISSING, "required")],
)
def test_a_value_is_shown_as_the_command_line_takes_it(value: Any, text: str) -> None:
    assert show(value) == text


def test_every_default_can_be_given_back_as_it_is_shown() -> None:
    techniques = [technique for _, technique in find_techniques()]
    members: dict[str, type] = {technique.name: technique for technique in techniques}
    for technique in techniques:
        flags = [(technique.name, field.name, show(field.default)) for field in fields_of(technique)]
        given = convert_flags(flags, members).get(technique.name, {})
        assert given == {field.name: field.default for field in fields_of(technique)}


def test_a_technique_or_a_family_is_found_by_name() -> None:
    ((family, froxel),) = find_techniques("froxel")
    assert (family, froxel.name) == ("volumetric", "froxel")
    assert froxel in [technique for _, technique in find_techniques("volumetric")]
    with pytest.raises(ParameterError, match="no technique or family 'volumetrc' — did you mean 'volumetric'"):
        find_techniques("volumetrc")
