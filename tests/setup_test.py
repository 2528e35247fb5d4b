"""The set-up script on machines that lack something: one clear line, and no environment left half made."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import tyndall

ROOT = Path(__file__).parents[1]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of what the script needs, with a ``bin`` that holds nothing but a shell's companions."""
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools/setup.sh", tmp_path / "tools/setup.sh")
    (tmp_path / "bin").mkdir()
    for tool in ("bash", "dirname", "env", "id"):
        found = shutil.which(tool)
        assert found
        (tmp_path / "bin" / tool).symlink_to(found)
    return tmp_path


def setup(project: Path) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(project / "bin"), "HOME": str(project), "PYENV_ROOT": str(project / "pyenv")}
    return subprocess.run(
        [project / "tools/setup.sh"], env=environment, capture_output=True, text=True, check=False, timeout=60
    )


def fake_python(project: Path, body: str) -> None:
    program = project / "bin/python3"
    program.write_text(f"#!{project}/bin/bash\n{body}\n")
    program.chmod(0o755)


def test_without_python_it_says_which_one_is_needed(project: Path) -> None:
    result = setup(project)
    assert (result.returncode, result.stdout) == (1, "")
    assert re.fullmatch(r"setup: Python 3\.12 or newer is needed, and there is no Python here: .*\n", result.stderr)
    assert not (project / ".venv").exists()


def test_an_old_python_is_named(project: Path) -> None:
    fake_python(project, 'if [ "$1" = --version ]; then echo "Python 3.9.2"; else exit 1; fi')
    result = setup(project)
    assert result.returncode == 1
    assert "3.12 or newer is needed, and there is Python 3.9.2 here" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_python_without_venv_says_what_to_install(project: Path) -> None:
    fake_python(project, 'case "$2" in *ensurepip*) exit 1;; *print*) echo 3.12;; esac')
    result = setup(project)
    assert result.returncode == 1
    assert result.stderr == "setup: Python's venv module is missing: apt-get install python3.12-venv\n"


def test_the_lock_pins_everything_by_hash_and_names_no_index() -> None:
    lock = (ROOT / "requirements.lock").read_text()
    pinned = re.findall(
        r"^([A-Za-z0-9][\w.-]*)==\S+.*?((?: *\\\n    --hash=sha256:[0-9a-f]{64})+)$", lock, re.MULTILINE
    )
    assert len(pinned) == len(re.findall(r"^\S", lock, re.MULTILINE))
    assert "://" not in lock
    assert "--index" not in lock
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = [*project["project"]["dependencies"], *project["dependency-groups"]["dev"]]
    names = {re.match(r"[\w.-]+", line)[0].lower() for line in wanted}  # type: ignore[index]
    assert names <= {name for name, _ in pinned}


def test_the_changelog_tells_of_this_version() -> None:
    assert f"\n## {tyndall.__version__}" in (ROOT / "CHANGELOG.md").read_text()


def test_the_wheel_holds_every_shader_and_the_command(tmp_path: Path) -> None:
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet"]
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", tmp_path / "wheels", tmp_path]
    subprocess.run([*pip, *options], check=True, capture_output=True, timeout=120)
    (wheel,) = (tmp_path / "wheels").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        entry_points = archive.read(f"tyndall-{tyndall.__version__}.dist-info/entry_points.txt").decode()
    suffixes = {".wesl", ".html", ".css", ".js"}
    assets = [path for path in (ROOT / "src").rglob("*") if path.suffix in suffixes]
    assert {path.suffix for path in assets} == suffixes
    assert {path.relative_to(ROOT / "src").as_posix() for path in assets} <= names
    assert "tyndall = tyndall.__main__:main" in entry_points
