"""What this machine can draw with, what is missing, and how to get it."""

from __future__ import annotations

import logging
import platform
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import RenderableType

log = logging.getLogger("tyndall")

GET_SOFTWARE = "apt-get install mesa-vulkan-drivers"

# What an adapter is used for, and what happens without it.
FEATURES = {
    "timestamp-query": "times the passes; without it no GPU times",
    "float32-blendable": "the polygonal technique needs it",
}
LIMITS = {
    "max-texture-dimension-2d": "pixels a side of a picture or a shadow map",
    "max-texture-dimension-3d": "froxels a side of a grid",
    "max-texture-array-layers": "shadow maps in one array",
    "max-storage-buffer-binding-size": "bytes in a binding; larger meshes are split",
    "max-buffer-size": "bytes in one buffer",
}
PACKAGES = ("tyndall", "wgpu", "wesl-py", "rendercanvas", "numpy", "pydantic", "typer", "rich", "pillow", "OpenEXR")
# Optional packages, and what installs them. Mitsuba is tried, and has a line of its own.
EXTRAS = {
    "flip-evaluator": "truth",
    "scikit-image": "truth",
    "dask": "sweep",
    "distributed": "sweep",
    "pyarrow": "sweep",
}


@dataclass(frozen=True)
class Adapter:
    """One way to draw.

    Attributes:
        kind: "DiscreteGPU", "IntegratedGPU", "VirtualGPU", "CPU" or "Unknown".
        chosen: a plain run takes this one.
    """

    name: str
    kind: str
    backend: str
    driver: str
    chosen: bool
    features: Mapping[str, bool]
    limits: Mapping[str, int]


@dataclass(frozen=True)
class Report:
    """Findings of :func:`diagnose`.

    Attributes:
        adapters: every adapter that answers, best first.
        missing: one line per problem, with its remedy; not each keeps Tyndall from drawing.
        extras: optional packages by version, None for one that is not installed.
        mitsuba: the variant of Mitsuba that can judge pictures here, and why no better one; or how to get it.
    """

    adapters: tuple[Adapter, ...]
    mitsuba: str
    python: str
    system: str
    packages: Mapping[str, str | None]
    extras: Mapping[str, str | None]
    missing: tuple[str, ...]

    @property
    def can_render(self) -> bool:
        return any(adapter.chosen for adapter in self.adapters) and None not in self.packages.values()

    def to_json(self) -> dict[str, Any]:
        return {
            "can_render": self.can_render,
            "adapters": [
                {
                    "name": a.name,
                    "kind": a.kind,
                    "backend": a.backend,
                    "driver": a.driver,
                    "chosen": a.chosen,
                    "features": dict(a.features),
                    "limits": dict(a.limits),
                }
                for a in self.adapters
            ],
            "mitsuba": self.mitsuba,
            "python": self.python,
            "system": self.system,
            "packages": dict(self.packages),
            "extras": dict(self.extras),
            "missing": list(self.missing),
        }

    def table(self) -> RenderableType:
        from rich.console import Group
        from rich.markup import escape
        from rich.table import Table
        from rich.text import Text

        parts: list[RenderableType] = []
        for adapter in self.adapters:
            mark = "[green]●[/]" if adapter.chosen else "[dim]○[/]"
            parts.append(Text.from_markup(f"{mark} [bold]{escape(adapter.name)}[/]  {adapter.kind}, {adapter.backend}"))
            parts.append(Text(f"  driver: {adapter.driver or 'unknown'}", style="dim"))
            table = Table(box=None, show_header=False, padding=(0, 0, 0, 2))
            table.add_column(no_wrap=True)
            for name, why in FEATURES.items():
                table.add_row(name, "[green]yes[/]" if adapter.features[name] else "[yellow]no[/]", f"[dim]{why}[/]")
            for name, why in LIMITS.items():
                table.add_row(name, f"{adapter.limits[name]:,}", f"[dim]{why}[/]")
            parts += [table, Text()]
        parts.append(Text.from_markup(f"[bold]Python[/] {self.python} on {self.system}"))
        parts.append(Text(", ".join(f"{name} {version or 'missing'}" for name, version in self.packages.items())))
        optional = [f"{name} {version or _get(name)}" for name, version in self.extras.items()]
        parts.append(Text(f"optional: {', '.join(optional)}"))
        parts.append(Text(f"truth by another renderer: {self.mitsuba}"))
        parts += [Text.from_markup(f"[yellow]![/] {escape(line)}") for line in self.missing]
        verdict = "[green]Tyndall can draw here.[/]" if self.can_render else "[red]Tyndall cannot draw here.[/]"
        parts.append(Text.from_markup(verdict))
        return Group(*parts)


def diagnose(adapter: str | None = None) -> Report:
    """Look at the machine. ``adapter`` is part of an adapter's name, as for a run; None looks for the best.

    Nothing is drawn; no adapter at all is a finding and not an error.
    """
    packages = {name: _version(name) for name in PACKAGES}
    missing = [f"the package {name} is missing: pip install {name}" for name, found in packages.items() if not found]
    adapters: tuple[Adapter, ...] = ()
    try:
        from tyndall.gpu.device import GpuError, choose_adapter
        from tyndall.gpu.device import adapters as find_adapters
    except (ImportError, OSError) as error:
        missing.append(f"wgpu does not load: {str(error).splitlines()[0]}")
    else:
        found = find_adapters()
        log.disabled = True  # what it would note is among the findings
        try:
            chosen = dict(choose_adapter(adapter).info) if found else None
        except GpuError as error:
            chosen = None
            missing.append(str(error))
        finally:
            log.disabled = False
        adapters = tuple(_describe(native, chosen) for native in found)
        if not found:
            missing.append(f"no graphics adapter answers: install your GPU's driver, or {GET_SOFTWARE}")
        elif all(a.kind == "CPU" for a in adapters):
            missing.append("only a software adapter answers, which is slow; with a GPU, install its Vulkan driver")
        if adapters and not any(a.features["timestamp-query"] for a in adapters):
            missing.append("no adapter has timestamp queries: passes cannot be timed")
    python = f"{platform.python_version()} ({sys.executable})"
    system = f"{platform.system()} {platform.release()} {platform.machine()}"
    extras = {name: _version(name) for name in EXTRAS}
    return Report(adapters, _mitsuba(), python, system, packages, extras, tuple(missing))


def _get(package: str) -> str:
    return f"missing (pip install 'tyndall[{EXTRAS[package]}]')"


def _mitsuba() -> str:
    """Tried in processes of its own; a second or two where it is installed."""
    try:
        from tyndall.lab.mitsuba import available
    except (ImportError, OSError):
        return "not looked for: wgpu does not load"
    return str(available())


def _describe(native: Any, chosen: Mapping[str, Any] | None) -> Adapter:
    info = dict(native.info)
    return Adapter(
        name=info["device"],
        kind=info["adapter_type"],
        backend=info["backend_type"],
        driver=info["description"],
        chosen=info == chosen,
        features={name: name in native.features for name in FEATURES},
        limits={name: int(native.limits.get(name, 0)) for name in LIMITS},
    )


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
