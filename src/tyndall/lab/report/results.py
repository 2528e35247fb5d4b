"""What a report is made from: the ``results.json`` of :meth:`tyndall.lab.compare.Comparison.save`, as data.

Only this file and the pictures that it names are read, so that a report can be written long after the measurement, on
another machine. Keys that an older version did not write are None or empty here; keys unknown here are left out.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import pydantic
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from tyndall.lab.picture import OutputError

FILE = "results.json"


class _Record(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class Times(_Record):
    """Milliseconds."""

    median: float
    min: float | None = None
    p95: float | None = None


def _times(value: Any) -> Any:
    return {"median": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


Milliseconds = Annotated[Times, BeforeValidator(_times)]
Metrics = dict[str, float | None]  # by name; a metric that does not exist for a picture is null


class Result(_Record):
    """One technique."""

    technique: str
    label: str
    model: str | None = None
    up_to_scale: bool = False  # its light is right up to a factor only
    gpu_ms: Milliseconds | None = None
    frame_ms: Milliseconds | None = None
    host_ms: Milliseconds | None = None
    memory_bytes: float | None = None
    errors: dict[str, Metrics] = Field(default_factory=dict)  # by kind of light
    passes: dict[str, Milliseconds] = Field(default_factory=dict)
    memory: dict[str, float] = Field(default_factory=dict)  # bytes by owner
    image: str | None = None
    exr: str | None = None
    still_exr: str | None = None


class Reference(_Record):
    """The truth, and how sure it is of itself."""

    judge: str
    image: str | None = None
    exr: str | None = None
    still_exr: str | None = None
    samples: int | None = None
    seconds: float | None = None
    relative_error: dict[str, float | None] = Field(default_factory=dict)  # by kind of light
    other: dict[str, Any] = Field(default_factory=dict)  # everything else that describes it


class Study(_Record):
    """One comparison.

    Attributes:
        folder: where its files are.
        exposure: the camera's, in EV; None where it was not recorded, and light cannot be shown as the picture was.
    """

    folder: Path
    scene: str
    size: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]
    results: Annotated[list[Result], Field(min_length=1)]
    adapter: str = "an unnamed adapter"
    driver: str | None = None
    family: str = "volumetric"
    triangles: int | None = None
    exposure: float | None = None
    reference: Reference | None = None
    versions: dict[str, str] = Field(default_factory=dict)
    parameters: dict[str, Any] = Field(default_factory=dict)
    scene_hash: str | None = None
    command: str | None = None
    skipped: dict[str, str] = Field(default_factory=dict)  # why a technique took no part
    missing: dict[str, str] = Field(default_factory=dict)  # why one has no errors

    @property
    def tonemap(self) -> str:
        """The name of the curve that the pictures went through."""
        chosen = self.parameters.get("tonemap")
        return str(chosen.get("technique", "aces")) if isinstance(chosen, dict) else "aces"

    @property
    def kinds(self) -> list[str]:
        """The kinds of light that errors were measured on; the first is what the comparison is about."""
        return list(dict.fromkeys(kind for result in self.results for kind in result.errors))

    def place(self, name: str) -> Path:
        """The path of a file that ``results.json`` names.

        Raises:
            OutputError: it is not inside the folder.
        """
        path = self.folder / name
        if not path.resolve().is_relative_to(self.folder.resolve()):
            raise OutputError(f"{self.folder / FILE}: '{name}' is not inside the folder")
        return path


def read(folder: Path) -> Study:
    """Read a folder's ``results.json``.

    Raises:
        OutputError: one line; the folder or the file does not exist, or the file is not what ``save`` writes.
    """
    path = folder / FILE
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        reason = "has no results.json; `tyndall compare` writes one" if folder.is_dir() else "is no folder"
        raise OutputError(f"{folder}: {reason}") from None
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise OutputError(f"{path}: is no JSON ({error})") from error
    if not isinstance(document, dict):
        raise OutputError(f"{path}: is no object")
    try:
        return Study.model_validate(_current(document) | {"folder": folder})
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
        raise OutputError(f"{path}: {where}: {first['msg'][:1].lower()}{first['msg'][1:]}") from error


def _current(document: dict[str, Any]) -> dict[str, Any]:
    """The document with what older versions wrote differently in today's form."""
    results = document.get("results")
    if isinstance(results, list):
        results = [_current_result(r) if isinstance(r, dict) else r for r in results]
    truth = document.get("reference")
    if isinstance(truth, dict):
        known = {name for name in Reference.model_fields if name != "other"}
        technique = truth.get("technique")
        truth = {"judge": str(technique or "truth"), **truth} | {
            "other": {key: value for key, value in truth.items() if key not in known},
        }
        if "image" not in truth and "samples" not in truth:  # before pictures of the reference were named
            truth |= {"image": "reference.png", "exr": "reference.exr"}
    return {**document, "results": results, "reference": truth}


def _current_result(result: dict[str, Any]) -> dict[str, Any]:
    image = result.get("image")
    name = Path(image).stem if isinstance(image, str) else str(result.get("technique"))
    current = {"label": name, **result}
    if "errors" not in result and isinstance(result.get("error"), dict):
        current["errors"] = {"inscattered": result["error"]}
    if "exr" not in result and isinstance(image, str):
        current["exr"] = f"{Path(image).stem}.exr"
    return current
