"""Errors of shaders stand where the author can find them: file, line and column of the WESL source."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.gpu.resources import Buffer
from tyndall.gpu.shader import ShaderError, create_module

_names = (f"test_shader_{i}" for i in itertools.count())


@pytest.fixture
def out(gpu: Gpu) -> Iterator[Buffer]:
    buffer = gpu.buffer("test.out", 64, owner="test", element="f32")
    yield buffer
    gpu.discard()
    buffer.destroy()
    gpu.forget_groups()


def run(gpu: Gpu, out: Buffer, body: str, *, imports: str = "", entry: str = "main") -> str:
    """Run a shader whose body begins on line 5; returns its name."""
    name = next(_names)
    head = f"{imports or '// nothing else'}\nimport package::bindings::out;\n"
    text = f"{head}@compute @workgroup_size(1)\nfn main() {{\n{body}\n}}\n"
    with props.module(gpu, name, text) as path:
        gpu.compute(name, path, entry).bind(out=out.read_write()).dispatch(1)
        gpu.wait()
    return name


@pytest.mark.parametrize(
    ("body", "line", "column", "message"),
    [
        ("    out[0] = 1.0 +;", 5, 19, "unexpected token `;`"),
        ("    let a = 1.0;\n    out[0] = banana;", 6, 14, "cannot find declaration of `banana`"),
        ("    let a = 1u;\n\n    out[0] = a + 1.5f;", 7, 5, "automatic conversions"),
        ("    let a = vec3f(1.0);\n    out[1] = a;", 6, 5, ""),
        ("    let a = vec3f(1.0);\n    out[1] = a.w;", 6, 5, ""),
        ("    let i = 1;\n    out[i] = 2.0 / 3u;", 6, 5, ""),
    ],
)
def test_position_in_the_source(gpu: Gpu, out: Buffer, body: str, line: int, column: int, message: str) -> None:
    with pytest.raises(ShaderError) as error:
        run(gpu, out, body)
    first = str(error.value).splitlines()[0]
    name, at, rest = first.split(":", 1)[0], *first.split(":", 1)[1].split(": ", 1)
    assert name.startswith("test_shader_")
    assert name.endswith(".wesl")
    assert at == f"{line}:{column}", first
    assert rest
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("line", "column", "text"),
    [
        # A fault of grammar, of types, of control flow.
        (3, 16, "// half\nfn half(x: f32) -> f32 {\n    return x / ;\n}\n"),
        (4, 5, "// half\nfn half(x: f32) -> f32 {\n    let y = 2u;\n    return x / y;\n}\n"),
        (2, 1, "// half\nfn half(x: f32) -> f32 {\n    var y = x;\n}\n"),
    ],
)
def test_position_in_an_imported_module(gpu: Gpu, out: Buffer, line: int, column: int, text: str) -> None:
    inner = next(_names).replace("shader", "inner")
    with props.module(gpu, inner, text) as path, pytest.raises(ShaderError) as error:
        run(gpu, out, "    out[0] = half(2.0);", imports=f"import {path}::half;")
    assert str(error.value).startswith(f"{inner}.wesl:{line}:{column}: ")


@pytest.mark.parametrize("imports", ["import package::bindings::nothing;", "import package::wesl::phase::fase;"])
def test_a_name_that_nobody_declares(gpu: Gpu, out: Buffer, imports: str) -> None:
    """A resource that the host did not bind, and a function that a module does not have."""
    name = imports.rpartition("::")[2].rstrip(";")
    with pytest.raises(ShaderError, match=rf"test_shader_\d+\.wesl:\d+:\d+: .*no declaration `{name}`"):
        run(gpu, out, f"    out[0] = {name}(0.0);", imports=imports)


def test_an_entry_point_that_is_not_there(gpu: Gpu, out: Buffer) -> None:
    with pytest.raises(ShaderError, match=r"\.wesl:1:1: .*`another`"):
        run(gpu, out, "    out[0] = 1.0;", entry="another")


def test_a_failed_shader_leaves_the_device_usable(gpu: Gpu, out: Buffer) -> None:
    with pytest.raises(ShaderError):
        run(gpu, out, "    out[0] = ;")
    run(gpu, out, "    out[0] = 42.0;")
    assert gpu.read_buffer(out).view(np.float32)[0] == 42


@pytest.mark.parametrize("trusted", [True, False])
def test_long_loops_in_trusted_and_untrusted_modules(gpu: Gpu, out: Buffer, trusted: bool) -> None:
    """Both kinds of module compile and run; 50 000 iterations give the exact sum (software adapters cut above 2^16)."""
    text = """
        @group(0) @binding(0) var<storage, read_write> out: array<f32>;
        @compute @workgroup_size(1)
        fn main() {
            var sum = 0u;
            for (var i = 0u; i < 50000u; i++) { sum += i & 255u; }
            out[0] = f32(sum);
        }
    """
    with props.module(gpu, next(_names), text) as path:
        linked = gpu.linker.link(path, ("main",), "", {}, {})
        native = create_module(gpu.device, gpu.linker, linked, "loop", trusted=trusted)
    pipeline = gpu.device.create_compute_pipeline(layout="auto", compute={"module": native, "entry_point": "main"})
    group = gpu.device.create_bind_group(
        layout=pipeline.get_bind_group_layout(0),
        entries=[{"binding": 0, "resource": {"buffer": out.native, "offset": 0, "size": 64}}],
    )
    native_pass = gpu.encoder.begin_compute_pass()
    native_pass.set_pipeline(pipeline)
    native_pass.set_bind_group(0, group)
    native_pass.dispatch_workgroups(1)
    native_pass.end()
    assert gpu.read_buffer(out).view(np.float32)[0] == sum(i & 255 for i in range(50000))


def test_out_of_bounds_writes_are_dropped_in_trusted_code(gpu: Gpu, out: Buffer) -> None:
    """Bounds checks stay on: a write beyond the buffer does not reach its neighbours."""
    neighbour = gpu.buffer("test.neighbour", np.full(64, 7, np.uint32), owner="test")
    run(gpu, out, "    for (var i = 0u; i < 4096u; i++) {\n        out[i] = f32(i);\n    }")
    assert (gpu.read_buffer(neighbour) == 7).all()
    neighbour.destroy()
