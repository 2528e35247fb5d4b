"""Workers give what the metrics give, and may die."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tyndall.lab import judging
from tyndall.lab.judging import Judges
from tyndall.lab.metrics import Scores, Target, score

LIGHT = np.random.default_rng(7).uniform(0.1, 3.0, (24, 32, 3)).astype(np.float32)
TARGETS = {"inscattered": Target(LIGHT, 0.1 * LIGHT), "radiance": Target(2 * LIGHT, None, LIGHT[..., 0] > 1)}


class Act:
    """What arrives in the worker as the value of a Python expression."""

    def __init__(self, expression: str) -> None:
        self.expression = expression

    def __reduce__(self) -> Any:
        return eval, (f"[(os := __import__('os')), (np := __import__('numpy')), {self.expression}][2]",)


def test_scores_are_those_of_the_metrics() -> None:
    with Judges(TARGETS, workers=2) as judges:
        for step in range(4):
            judges.submit(f"{step}", {kind: (1 + step / 10) * t.light for kind, t in TARGETS.items()})
        heard: list[float] = []
        found = judges.gather(heard.append)
    assert heard == [0.25, 0.5, 0.75, 1]
    assert list(found) == ["0", "1", "2", "3"]
    for step in range(4):
        expected = {kind: score((1 + step / 10) * t.light, t) for kind, t in TARGETS.items()}
        assert found[f"{step}"] == expected


def test_a_worker_that_dies_is_asked_once_more(tmp_path: Path) -> None:
    flag = tmp_path / "died"
    once = f"np.ones((24, 32, 3)) if os.path.exists({str(flag)!r}) else (os.mkdir({str(flag)!r}), os._exit(3))"
    with Judges(TARGETS, workers=1) as judges:
        judges.submit("dies once", {"radiance": Act(once)})  # type: ignore[dict-item]
        judges.submit("after it", {"radiance": LIGHT})
        found = judges.gather()
    assert flag.exists()
    assert found["dies once"] == {"radiance": score(np.ones((24, 32, 3)), TARGETS["radiance"])}
    assert found["after it"] == {"radiance": score(LIGHT, TARGETS["radiance"])}


def test_a_picture_that_kills_twice_has_no_scores_and_the_rest_goes_on() -> None:
    with Judges(TARGETS, workers=1) as judges:
        judges.submit("deadly", {"radiance": Act("os._exit(7)")})  # type: ignore[dict-item]
        judges.submit("after it", {"radiance": LIGHT})
        found = judges.gather()
    assert found["deadly"] == "the process that measures them died twice (exit code 7)"
    assert isinstance(found["after it"], dict)


def test_a_picture_that_cannot_be_compared_says_why() -> None:
    with Judges(TARGETS, workers=1) as judges:
        judges.submit("too small", {"radiance": LIGHT[1:]})
        judges.submit("right", {"radiance": LIGHT})
        found = judges.gather()
    assert "shape" in str(found["too small"])
    assert isinstance(found["right"], dict)


def test_workers_load_no_device_and_print_nowhere(capfd: pytest.CaptureFixture[str]) -> None:
    loud = "(os.write(1, b'noise'), np.full((24, 32, 3), 'wgpu' in __import__('sys').modules, float))[1]"
    with Judges(TARGETS, workers=1) as judges:
        judges.submit("loud", {"radiance": Act(loud)})  # type: ignore[dict-item]
        (scores,) = judges.gather().values()
    assert isinstance(scores, dict)
    assert scores["radiance"].bias == pytest.approx(-1), "wgpu is loaded"
    assert capfd.readouterr().out == ""


def test_leaving_ends_the_workers_at_once() -> None:
    begun = time.monotonic()
    with Judges(TARGETS, workers=1) as judges:
        judges.submit("slow", {"radiance": Act("__import__('time').sleep(60)")})  # type: ignore[dict-item]
        while judges._workers[0]._process is None:
            time.sleep(0.01)
        process = judges._workers[0]._process
    assert time.monotonic() - begun < 20
    assert process.poll() is not None


def test_a_machine_without_processes_has_no_scores_but_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging.sys, "executable", "/no/such/python")
    with Judges(TARGETS) as judges:
        judges.submit("one", {"radiance": LIGHT})
        (answer,) = judges.gather().values()
    assert isinstance(answer, str)
    assert "\n" not in answer


def test_a_script_without_a_guard_runs_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np\n"
        "from tyndall.lab.judging import Judges\n"
        "from tyndall.lab.metrics import Target\n"
        "print('begun')\n"
        "light = np.ones((16, 16, 3))\n"
        "with Judges({'radiance': Target(light)}) as judges:\n"
        "    judges.submit('a', {'radiance': 2 * light})\n"
        "    print(judges.gather()['a']['radiance'].bias)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    result = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, env=environment, timeout=60
    )
    assert (result.returncode, result.stdout.split()) == (0, ["begun", "1.0"]), result.stderr


def test_there_is_at_least_one_worker_and_a_core_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []
    for count in (1, 2, 4, 64):
        monkeypatch.setattr(judging, "cores", lambda count=count: count)
        with Judges(TARGETS) as judges:
            counts.append(len(judges._workers))
    assert counts == [1, 1, 3, 4]


def test_scores_travel_whole() -> None:
    scores = score(1.5 * LIGHT, TARGETS["radiance"])
    assert isinstance(scores, Scores)
    assert scores.boundary is not None
