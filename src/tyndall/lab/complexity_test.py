"""Lines of code are counted as a reader would."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from tyndall.lab.complexity import lines_of, python_lines, shader_lines
from tyndall.techniques import FAMILIES

SHADOWS = FAMILIES["shadow"].members


def test_docstrings_comments_and_blank_lines_do_not_count() -> None:
    code = '''
        """Module,
        of two lines."""
        import os  # 1

        # a comment
        class A:  # 2
            """Class."""
            x = 1  # 3
            """What x is."""

            def f(self):  # 4
                """Function."""
                text = """kept  # 5
                # 6: a line of a string that is used
                """  # 7
                return (  # 8
                    text,  # 9
                )  # 10
    '''
    assert python_lines(textwrap.dedent(code)) == 10


def test_comments_of_shaders_do_not_count() -> None:
    assert shader_lines("import a::b; // why\n\n/* two\nlines */ const c = 1;\n// none\nfn f() {}\n") == 3


def test_a_comment_added_changes_nothing_and_a_statement_does() -> None:
    own = Path(lines_of.__code__.co_filename).read_text(encoding="utf-8")
    assert python_lines(own + "\n# more\n\n") == python_lines(own)
    assert python_lines(own + "\nx = 1\n") == python_lines(own) + 1


@pytest.mark.parametrize("name", SHADOWS)
def test_every_technique_has_code_of_its_own(name: str) -> None:
    found = lines_of(SHADOWS[name])
    assert found.host > 10
    assert found.shader > 0 or found.below > 0


def test_rays_stand_on_a_tree_and_a_map_does_not() -> None:
    rays, maps = lines_of(SHADOWS["ray_traced"]), lines_of(SHADOWS["shadow_map"])
    tree = sum(
        count(Path(lines_of.__code__.co_filename).parents[1].joinpath("tracing", file).read_text(encoding="utf-8"))
        for file, count in (("bvh.py", python_lines), ("world.py", python_lines), ("build.wesl", shader_lines))
    )
    assert rays.below >= tree + maps.host + maps.shader, "its air may be answered by maps"
    assert maps.below <= rays.below - tree, "a map needs no tree"
