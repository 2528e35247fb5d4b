"""What the benchmarks have in common: a device that can time, and a document of figures, saved with its tables."""

from __future__ import annotations

import json
import os
from abc import ABC, abstractmethod
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from tyndall.gpu.device import Gpu, GpuError
from tyndall.lab.picture import write_texts


@dataclass(frozen=True)
class Figures(ABC):
    """The figures of one run, as plain data (:meth:`to_json`) and as tables (:meth:`markdown`).

    Attributes:
        name: of the benchmark, and of its files.
        notes: what a reader should know of how they came about, a line each.
    """

    name: ClassVar[str]

    document: Mapping[str, Any]
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps``."""
        return dict(self.document)

    @abstractmethod
    def markdown(self) -> str:
        """All tables, as they stand in ``docs/benchmarks.md``."""

    def __str__(self) -> str:
        return self.markdown()

    def files(self) -> dict[str, str]:
        """What is saved, texts by file name: ``NAME.json`` and ``NAME.md``."""
        return {f"{self.name}.json": text_of(self.document), f"{self.name}.md": self.markdown()}

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write :meth:`files` into a folder, which is made.

        Raises:
            OutputError: ``folder`` is a file, or the system refuses.
        """
        target = Path(folder)
        write_texts(target, self.files())
        return target


def text_of(document: Mapping[str, Any]) -> str:
    """A document as its file has it."""
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def check_times(features: Container[str]) -> None:
    """Raises GpuError where an adapter of these features cannot time what it draws."""
    if "timestamp-query" not in features:
        raise GpuError("this adapter cannot time what it draws (timestamp-query), and a benchmark is of times")


@contextmanager
def timed_device(adapter: str | Gpu | None) -> Iterator[Gpu]:
    """A device by part of its adapter's name, closed at the end, or one that is shared and stays open.

    Raises:
        GpuError: no such adapter, or one that cannot time what it draws.
    """
    gpu = adapter if isinstance(adapter, Gpu) else Gpu(adapter)
    try:
        check_times(gpu.features)
        yield gpu
    finally:
        if gpu is not adapter:
            gpu.close()
