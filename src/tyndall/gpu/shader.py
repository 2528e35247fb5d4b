"""WESL modules, linked at run time into WGSL (https://wesl-lang.dev; the linker is wesl-py).

Every ``*.wesl`` file of the package is a module, named by its path: ``techniques/volumetric/froxel.wesl`` is
``package::techniques::volumetric::froxel``. Two kinds of modules are virtual:

- ``package::bindings`` declares what the host bound to the pass, by name. Shaders import the names they use; binding
  numbers, group layouts and structs of parameters are generated from what was bound.
- an *overlay* gives a module a second name, so that a shader can import ``package::visibility`` without knowing which
  shadow technique stands behind it.

Errors of the linker and of the driver are reported with file, line and column of the WESL source.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from typing import Any

import numpy as np
import wesl
import wgpu

_BINDINGS = "package::bindings"
_USED = re.compile(r"@group\(0\)\s*@binding\((\d+)\)")
_VIRTUAL_IMPORT = re.compile(
    r"import\s+(package::(?:bindings|visibility|surface_visibility|occlusion))::(\{[^}]*\}|\w+)\s*;"
)
_ATTRIBUTE = re.compile(r"@\w+(?:\([^)]*\))?\s*")
_SWITCH = re.compile(r"^const (\w+) = (true|false);$", re.MULTILINE)
_WORKGROUP = re.compile(r"@workgroup_size\s*\(((?:\s*\d+[iu]?\s*,?)+)\)")
_DECLARATION = re.compile(r"(?:fn|struct|const|override|var(?:<[^>]*>)?)\s+(\w+)")
# Line numbers of the driver's report. A fault of grammar has its place in the heading, "┌─ wgsl:4:5"; a fault of
# meaning names the function there, and underlines what it found, of which the last is the statement that failed.
_DRIVER_GRAMMAR = re.compile(r"┌─ wgsl:(\d+):\d+$", re.MULTILINE)
_DRIVER_HEADING = re.compile(r"┌─ wgsl:(\d+):(\d+)$", re.MULTILINE)
_DRIVER_MARKED = re.compile(r"^\s*(\d+) │.*\n\s*│[ │]*\^", re.MULTILINE)
_DRIVER_FUNCTION = re.compile(r"┌─ .*:(\d+):\d+$", re.MULTILINE)


class ShaderError(RuntimeError):
    """A shader that does not link or validate; the message starts with ``file:line:column``."""


@dataclass(frozen=True)
class Linked:
    """A linked module: its WGSL, the root module's name and the binding numbers that it uses."""

    wgsl: str
    module: str
    used: frozenset[int]


@dataclass
class Linker:
    """All modules of the package, and the virtual ones given per link."""

    modules: dict[str, str] = field(default_factory=dict)
    filenames: dict[str, str] = field(default_factory=dict)
    _dtypes: dict[str, np.dtype[Any]] = field(default_factory=dict, repr=False)

    @classmethod
    def of_package(cls, package: str = "tyndall") -> Linker:
        loaded = wesl.load_modules(files(package), namespace="package")
        return cls(dict(loaded.modules), dict(loaded.filenames))

    @cached_property
    def _compiler(self) -> wesl.Compiler:
        # Reflection wants every imported name to exist, though it reads none of the virtual modules' declarations.
        virtual: dict[str, set[str]] = {}
        for text in self.modules.values():
            for module, names in _VIRTUAL_IMPORT.findall(text):
                virtual.setdefault(module, set()).update(re.findall(r"\w+", names))
        stubs = {
            module: "".join(f"const {name} = 0u;\n" for name in sorted(names)) for module, names in virtual.items()
        }
        return wesl.Compiler(modules={**self.modules, **stubs}, filenames=self.filenames)

    def dtype(self, path: str) -> np.dtype[Any]:
        """The numpy layout of a WESL struct, ``package::wesl::light::Light``; its itemsize is the array stride."""
        if path not in self._dtypes:
            self._dtypes[path] = self._layout_alone(path) or wesl.reflect.numpy_dtype(self._compiler, path)
        return self._dtypes[path]

    def _layout_alone(self, path: str) -> np.dtype[Any] | None:
        """The layout of a struct that needs nothing else of its module, whose imports would all be parsed."""
        module, _, name = path.rpartition("::")
        struct = re.search(rf"^struct {name} {{[^}}]*}}", self.modules.get(module, ""), re.MULTILINE)
        if struct is None or "@if" in struct[0]:
            return None
        try:
            return wesl.reflect.numpy_dtype(wesl.Compiler(modules={module: struct[0]}), path)
        except wesl.CompileError:
            return None

    def workgroup(self, linked: Linked, entry: str) -> tuple[int, int, int]:
        """The workgroup size of a compute entry point."""
        head = re.search(rf"((?:@\w+\s*(?:\([^)]*\))?\s*)+)fn\s+{entry}\b", linked.wgsl)
        size = _WORKGROUP.search(head[1]) if head else None
        if size:  # plain numbers; asking the linker takes as long as linking
            x, y, z = (int(number) for number in (*re.findall(r"\d+", size[1]), 1, 1)[:3])
            return x, y, z
        for point in wesl.reflect.classify_entry_points(self._compiler, linked.module):
            if point.fn_name == entry and point.workgroup_size is not None:
                return point.workgroup_size
        raise ShaderError(f"{self.filenames.get(linked.module, linked.module)}:1:1: no compute entry point '{entry}'")

    def link(
        self,
        module: str,
        entries: tuple[str, ...],
        bindings: str,
        overlay: Mapping[str, str],
        features: Mapping[str, bool],
    ) -> Linked:
        """Link the entry points of ``module``.

        Args:
            module: root module, ``package::…``.
            entries: names of the entry points to keep.
            bindings: text of ``package::bindings``. Its ``const NAME = true;`` are switches as well, so that a shader
                may leave out what it will not reach: the driver translates all that is there.
            overlay: virtual module name → real module name.
            features: switches for ``@if``.

        Raises:
            ShaderError: a module does not parse or a name is missing.
        """
        modules = {**self.modules, _BINDINGS: bindings}
        names = {**self.filenames, _BINDINGS: "<bindings>"}
        for alias, real in overlay.items():
            modules[alias], names[alias] = self.modules[real], self.filenames[real]
        try:
            switches = {name: value == "true" for name, value in _SWITCH.findall(bindings)} | dict(features)
            result = wesl.compile(modules, root=module, keep=list(entries), filenames=names, features=switches)
        except wesl.CompileError as error:
            raise ShaderError(_describe(error, names.get(module, module))) from None
        used = frozenset(int(n) for n in _USED.findall(result.wgsl))
        return Linked(result.wgsl, module, used)

    def locate(self, linked: Linked, line: int) -> str:
        """``file:line:column`` of a line of linked WGSL: the source line that it was printed from.

        The linker keeps declarations whole and prefixes the names of imported ones with their module, so the
        declaration around the line names the module, and the source line there that shares the most words is the one.
        """
        lines = linked.wgsl.splitlines()
        if not 0 < line <= len(lines):
            return f"{self.filenames[linked.module]}:1:1"
        module = linked.module
        for start in range(line - 1, -1, -1):
            if match := _DECLARATION.match(_ATTRIBUTE.sub("", lines[start])):
                module = next((m for m in self.modules if match.group(1).startswith(_mangled(m))), linked.module)
                break
        words = set(re.findall(r"\w+", lines[line - 1].replace(_mangled(module), "")))
        words |= {re.sub(r"^\w+_(?:_\d+)?", "", word) for word in words if word.startswith("package_")}
        sources = list(enumerate(self.modules[module].splitlines(), 1))
        number, text = max(sources, key=lambda item: (len(words & set(re.findall(r"\w+", item[1]))), -len(item[1])))
        return f"{self.filenames[module]}:{number}:{len(text) - len(text.lstrip()) + 1}"


def _mangled(module: str) -> str:
    """The prefix that the linker gives to a module's names: a part with n underscores is preceded by ``_n``."""
    parts = [f"_{part.count('_')}{part}" if "_" in part else part for part in module.split("::")]
    return "_".join(parts) + "_"


def _describe(error: wesl.CompileError, fallback: str) -> str:
    if not error.diagnostics:
        return f"{fallback}:1:1: {error}"
    return "\n".join(
        f"{d.filename or d.module or fallback}:{d.line or 1}:{d.column or 1}: {d.message}" for d in error.diagnostics
    )


def create_module(
    device: wgpu.GPUDevice, linker: Linker, linked: Linked, label: str, *, trusted: bool = True
) -> wgpu.GPUShaderModule:
    """A shader module for the driver.

    ``trusted`` code keeps bounds checks but drops the iteration limit that wgpu-native adds to every loop, which
    costs up to 2.5× (measured on an H200). Code that a user wrote must not be trusted.

    Raises:
        ShaderError: the driver's validator refused it; positions are those of the WESL source.
    """
    try:
        if trusted:
            module = _create_trusted(device, linked.wgsl, label)
            if module is not None:
                return module
        return device.create_shader_module(label=label, code=linked.wgsl)
    except (wgpu.GPUError, RuntimeError) as error:
        text = str(error)
        found = (p.findall(text) for p in (_DRIVER_GRAMMAR, _DRIVER_MARKED, _DRIVER_FUNCTION))
        line = next((lines[-1] for lines in found if lines), None)
        where = linker.locate(linked, int(line)) if line else f"{label}:1:1"
        detail = [line.strip() for line in text.splitlines() if line.strip()]
        raise ShaderError(f"{where}: " + "\n".join(detail)) from None


def diagnose(device: wgpu.GPUDevice, wgsl: str) -> tuple[int, int, str] | None:
    """Line, column (from 1) and message of the first fault that the driver finds in WGSL; None where there is none."""
    try:
        device.create_shader_module(label="checked", code=wgsl)
    except (wgpu.GPUError, RuntimeError) as error:
        text = str(error)
        if heading := _DRIVER_HEADING.search(text):
            place, message = (int(heading[1]), int(heading[2])), re.search(r"parsing error: (.*)", text)
            marked = re.search(r"\^+ (\S.*)$", text, re.MULTILINE)
            parts = [message[1] if message else "", marked[1] if marked else ""]
        else:
            place = (1, 1)
            lines = text.splitlines()
            margin = 2 if "╭" in text else 0  # of a function that is marked as a whole beside what is underlined
            for above, line in itertools.pairwise(lines):
                number = re.match(r"\s*(\d+) │ ", above)
                if number and "^" in line and "╰" not in line:
                    place = int(number[1]), line.index("^") - number.end() - margin + 1
            parts = re.findall(r"^\s*= (.*)", text, re.MULTILINE) or text.strip().splitlines()[-1:]
        return *place, ": ".join(dict.fromkeys(part for part in parts if part)) or "it does not compile"
    return None


def _create_trusted(device: wgpu.GPUDevice, code: str, label: str) -> wgpu.GPUShaderModule | None:
    """wgpuDeviceCreateShaderModuleTrusted of wgpu-native, which wgpu-py 0.32 does not wrap; None if missing."""
    try:
        from wgpu.backends.wgpu_native import _api as api

        create = api.libf.wgpuDeviceCreateShaderModuleTrusted
        source = api.new_struct_p("WGPUShaderSourceWGSL *", code=api.to_c_string_view(code))
        source[0].chain.next = api.ffi.NULL
        source[0].chain.sType = api.lib.WGPUSType_ShaderSourceWGSL
        descriptor = api.new_struct_p(
            "WGPUShaderModuleDescriptor *",
            nextInChain=api.ffi.cast("WGPUChainedStruct *", source),
            label=api.to_c_string_view(label),
        )
        bounds_checks_only = 1
    except (ImportError, AttributeError):
        return None
    handle = create(device._internal, descriptor, bounds_checks_only)
    if handle == api.ffi.NULL:
        return None
    return api.GPUShaderModule(label, handle, device)
