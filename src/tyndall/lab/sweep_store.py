"""The folder of a sweep: rows as they are measured, and the table that they end in.

``results.jsonl`` holds a JSON object a line, a line a point. A row is appended whole and forced to the disk before
its worker begins another, so that a run that is killed loses what was being measured and nothing else. A line that was
cut off by that is removed when the folder is opened again. Of two rows of one point the later one counts. While a run
has the folder, the file is locked, and a second run is refused.
"""

from __future__ import annotations

import csv
import importlib.util
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Literal

from tyndall.gpu.params import ParameterError
from tyndall.gpu.resources import Closing
from tyndall.lab.filelock import try_lock
from tyndall.lab.picture import OutputError, check_folder, write_atomically
from tyndall.techniques import FAMILIES

Row = Mapping[str, Any]
Format = Literal["parquet", "csv"]

RESULTS = "results.jsonl"
_OBJECTS = ("gpu_ms", "shadow_ms", "frame_ms", "host_ms", "errors", "versions")  # of a row that is done, where known
_TECHNIQUES = ("technique", *FAMILIES)  # the fields of a point that describe a technique


class Store(Closing):
    """The rows of a folder, open for more.

    Args:
        folder: made where it does not exist.

    Attributes:
        rows: the last row of each point, by its id.
        damaged: lines in the middle of the file that hold no row; they are left where they are.

    Raises:
        OutputError: ``folder`` is a file, cannot be written, or another run has it.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self.path = self.folder / RESULTS
        check_folder(self.folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
        except OSError as error:
            raise OutputError(f"{self.path}: {error.strerror or error}") from error
        try:
            if not try_lock(self._file):
                raise OutputError(f"{self.folder}: another sweep is writing there")
            self.rows, self.damaged = self._read()
        except BaseException:
            os.close(self._file)
            raise

    def _read(self) -> tuple[dict[str, Row], int]:
        raw = self.path.read_bytes()
        whole = raw.rfind(b"\n") + 1
        if whole < len(raw):
            os.ftruncate(self._file, whole)
        rows, damaged = {}, 0
        for line in raw[:whole].splitlines():
            row = _parsed(line)
            if row is None:
                damaged += 1
            else:
                rows[str(row["id"])] = row
        return rows, damaged

    def add(self, row: Row) -> None:
        """Append a row; when this returns it is on the disk.

        Raises:
            OutputError: it cannot be written; what was there before still is.
        """
        line = json.dumps(row, ensure_ascii=False, allow_nan=False).encode() + b"\n"
        before = os.fstat(self._file).st_size
        try:
            append(self._file, line)
        except OSError as error:
            os.ftruncate(self._file, before)
            raise OutputError(
                f"{self.path}: {error.strerror or error}; the {len(self.rows)} rows before are kept"
            ) from error
        self.rows[str(row["id"])] = row

    def close(self) -> None:
        """Let others have the folder."""
        os.close(self._file)


def append(file: int, data: bytes) -> None:
    """Write all of ``data`` at the end of an open file, and onto the disk.

    Raises:
        OSError: the system refuses, maybe after a part of it.
    """
    while data:
        data = data[os.write(file, data) :]
    os.fsync(file)


def _parsed(line: bytes) -> Row | None:
    """The row in a line; None where that is no whole row, one with all that is read of it later."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not (isinstance(row, dict) and isinstance(row.get("id"), str) and isinstance(row.get("point"), dict)):
        return None
    reason = row.get("reason")
    if row.get("status") == "done":
        whole = isinstance(row.get("memory_bytes"), (int, float)) and all(
            isinstance(row.get(name), (dict, NoneType)) for name in _OBJECTS
        )
    else:
        whole = row.get("status") in ("failed", "unsupported") and isinstance(reason, str)
    return row if whole else None


def table_format(asked: Format | None) -> Format:
    """The kind of table to write: the one asked for, or else Parquet where pyarrow is there, and CSV where it is not.

    Raises:
        ParameterError: Parquet was asked for, and pyarrow is missing.
    """
    if asked not in (None, "parquet", "csv"):
        raise ParameterError(f"format: '{asked}' is not one of 'parquet', 'csv'")
    can = importlib.util.find_spec("pyarrow") is not None
    if asked == "parquet" and not can:
        raise ParameterError("format: Parquet needs pyarrow: pip install 'tyndall[sweep]'")
    return asked or ("parquet" if can else "csv")


def save_table(rows: Iterable[Row], folder: Path, kind: Format) -> Path:
    """Write the rows as ``results.parquet`` or ``results.csv``, a column for everything that any row holds.

    Raises:
        OutputError: it cannot be written.
    """
    columns = columns_of([flat(row) for row in rows])
    path = folder / f"results.{kind}"
    write_atomically(path, lambda draft: (_write_parquet if kind == "parquet" else _write_csv)(columns, draft))
    return path


def flat(row: Row) -> dict[str, Any]:
    """A row without inner objects: ``gpu_ms.median``, ``technique``, ``froxel.grid``; a list is ``64x36x32``."""
    found: dict[str, Any] = {}

    def add(name: str, value: Any) -> None:
        if isinstance(value, Mapping):
            for key, inner in value.items():
                add(f"{name}.{key}", inner)
        elif isinstance(value, (list, tuple)):
            found[name] = "x".join(map(str, value))
        else:
            found[name] = value

    for name, value in row.items():
        if name != "point":
            add(name, value)
            continue
        for part, inner in value.items():
            if part in _TECHNIQUES:
                found[part] = inner["technique"]
                for parameter, setting in inner.items():
                    if parameter != "technique":
                        add(f"{inner['technique']}.{parameter}", setting)
            elif part == "size":
                found["width"], found["height"] = inner
            else:
                add("asked.truth" if part == "truth" else part, inner)
    return found


def columns_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Flat rows by column; None where a row has no such value. A column holds one type: text where they differ."""
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: [row.get(name) for row in rows] for name in names}
    for name, values in columns.items():
        kinds = {type(value) for value in values if value is not None}
        if kinds == {int, float}:
            columns[name] = [None if value is None else float(value) for value in values]
        elif len(kinds) != 1:
            columns[name] = [None if value is None else str(value) for value in values]
    return columns


def _write_csv(columns: Mapping[str, list[Any]], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def _write_parquet(columns: Mapping[str, list[Any]], path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    text = {name: pyarrow.array(v, pyarrow.string()) if all(i is None for i in v) else v for name, v in columns.items()}
    pyarrow.parquet.write_table(pyarrow.table(text), path)
