"""One holder at a time, and a holder that dies lets go."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tyndall.lab.filelock import device_lock, try_lock


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_device_is_held_by_one_at_a_time_and_others_are_not() -> None:
    inside: list[str] = []
    most = []

    def measure(name: str) -> None:
        with device_lock(name):
            inside.append(name)
            most.append(inside.count(name))
            time.sleep(0.02)
            inside.remove(name)

    threads = [threading.Thread(target=measure, args=("one",)) for _ in range(5)]
    with device_lock("two"):
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(timeout=20)
    assert most == 5 * [1]


def test_a_process_that_is_killed_lets_go() -> None:
    program = "import time\nfrom tyndall.lab.filelock import device_lock\nwith device_lock('one'):\n"
    program += "    print('held', flush=True)\n    time.sleep(60)\n"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == b"held"
        process.kill()
        process.wait()
        begun = time.monotonic()
        with device_lock("one"):
            assert time.monotonic() - begun < 5


def test_a_locked_file_is_refused_until_it_is_closed(tmp_path: Path) -> None:
    first, second = (os.open(tmp_path / "file", os.O_RDWR | os.O_CREAT) for _ in range(2))
    assert try_lock(first)
    assert not try_lock(second)
    os.close(first)
    assert try_lock(second)
    os.close(second)


def test_without_a_cache_folder_there_is_no_lock_and_no_error(cache: Path) -> None:
    cache.write_text("a file")
    with device_lock("one"), device_lock("one"):
        pass
