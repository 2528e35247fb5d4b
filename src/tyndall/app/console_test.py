from __future__ import annotations

import logging
import warnings

import pytest

from tyndall.app import console


def test_many_lines_are_counted_and_not_shown(capsys: pytest.CaptureFixture[str]) -> None:
    console.say("\n".join(f"mistake {i}" for i in range(30)))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "tyndall: mistake 0"
    assert len(lines) == 10
    assert lines[-1] == "tyndall: … and 21 more"


def test_notes_and_warnings_follow_work_that_ends_well(capsys: pytest.CaptureFixture[str]) -> None:
    log = logging.getLogger("tyndall")
    with console.Work("testing") as work:
        log.warning("a slow adapter")
        warnings.warn("a field is left out", stacklevel=1)
        log.warning("a slow adapter")
        work.advance(0.5, "half")
        assert capsys.readouterr().err == ""
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "tyndall: a slow adapter\ntyndall: a field is left out\n"
    assert log.propagate
    assert not log.handlers


def test_notes_are_told_while_long_work_goes_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console, "_HOLD_SECONDS", 0.0)
    with console.Work("testing") as work:
        logging.getLogger("tyndall").warning("a slow adapter")
        work.advance(0.5, "half")
        assert capsys.readouterr().err == "tyndall: a slow adapter\n"


def test_an_error_is_alone(capsys: pytest.CaptureFixture[str]) -> None:
    def fail() -> None:
        with console.Work("testing"):
            logging.getLogger("tyndall").warning("a slow adapter")
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        fail()
    assert capsys.readouterr().err == ""
