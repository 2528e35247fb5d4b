"""The device: limits, ledger, bytes, names and times of passes."""

from __future__ import annotations

import os
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import props
import pytest
import wgpu

from tyndall.frame import Renderer
from tyndall.gpu import device
from tyndall.gpu.device import Gpu, GpuError, adapters, choose_adapter, choose_adapters
from tyndall.gpu.resources import BYTES_PER_TEXEL, Buffer, texel_dtype
from tyndall.gpu.shader import ShaderError
from tyndall.scene.model import DirectionalLight, Medium, PointLight, Scene
from tyndall.techniques import FAMILIES
from tyndall.techniques.shadow.shadow_map import ShadowMap

LIT_WALL = Scene([props.wall(-4)], [DirectionalLight((0, 0, -1), 1.0)], props.AHEAD, Medium(0.1))


def test_an_unknown_adapter_is_refused_with_those_there_are(gpu: Gpu) -> None:
    with pytest.raises(GpuError) as error:
        choose_adapter("voodoo 2")
    assert "no adapter matches 'voodoo 2'" in str(error.value)
    assert repr(gpu.adapter_info["device"]) in str(error.value)
    assert "\n" not in str(error.value)


def test_an_adapter_is_found_by_a_part_of_its_name_or_backend(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    name = gpu.adapter_info["device"]
    assert choose_adapter(name[:6].upper()).info["device"] == name
    assert choose_adapter(gpu.adapter_info["backend_type"].lower()).info["backend_type"] == "Vulkan"
    monkeypatch.setenv("TYNDALL_ADAPTER", "voodoo 2")
    with pytest.raises(GpuError, match="voodoo 2"):
        choose_adapter()
    assert choose_adapter(name).info["device"] == name, "what is asked for goes before the environment"


@pytest.mark.parametrize(
    ("size", "dimension", "message"),
    [
        ((10**6, 4), "2d", r"big: 1000000×4×1 texels; this adapter's limit is \d+"),
        ((4, 4, 10**5), "2d-array", r"big: 4×4×100000 texels; this adapter's limit is \d+ layers"),
        ((4, 4, 10**5), "3d", r"big: 4×4×100000 texels; this adapter's limit is \d+"),
        ((0, 4), "2d", "big: 0×4×1 texels"),
    ],
)
def test_textures_beyond_the_limits(gpu: Gpu, size: tuple[int, ...], dimension: str, message: str) -> None:
    total = gpu.ledger.total
    with pytest.raises(GpuError, match=message) as error:
        gpu.texture("big", size, "r32float", owner="test", dimension=dimension)
    assert "\n" not in str(error.value)
    assert gpu.ledger.total == total


def test_buffers_beyond_the_limits(gpu: Gpu) -> None:
    with pytest.raises(GpuError, match=r"big: 1000000000000000 bytes; a buffer of this adapter holds \d+"):
        gpu.buffer("big", 10**15, owner="test")


@pytest.mark.parametrize("size", [(0, 4), (10**6, 10)])
def test_pictures_that_cannot_be(gpu: Gpu, size: tuple[int, int]) -> None:
    before = gpu.ledger.total
    with pytest.raises(GpuError, match=str(max(size))) as error:
        Renderer(LIT_WALL, size, gpu=gpu)
    assert "\n" not in str(error.value)
    assert gpu.ledger.total == before, "a refused renderer leaves nothing behind"


@pytest.mark.parametrize("format", [f for f in BYTES_PER_TEXEL if "stencil" not in f])
def test_bytes_of_a_texture_are_those_of_its_texels(gpu: Gpu, format: str) -> None:
    scalar, channels = texel_dtype(format)
    texel = np.dtype(scalar).itemsize * channels
    for size, dimension, texels in (((5, 3), "2d", 15), ((5, 3, 4), "2d-array", 60)):
        usage = "sampled target" if format.startswith("depth") else "sampled"
        texture = gpu.texture("test", size, format, owner="test", dimension=dimension, usage=usage)
        assert texture.size_bytes == texels * texel
        assert ("test", "test", texels * texel) in list(gpu.ledger)
        texture.destroy()
        texture.destroy()
        assert "test" not in gpu.ledger.by_owner()


def test_bytes_of_mips_and_volumes(gpu: Gpu) -> None:
    pyramid = gpu.texture("test", (8, 4), "rgba8unorm", owner="test", usage="sampled", mips=4)
    assert pyramid.size_bytes == 4 * (8 * 4 + 4 * 2 + 2 * 1 + 1 * 1)
    volume = gpu.texture("test", (8, 4, 2), "rgba16float", owner="test", dimension="3d", mips=2)
    assert volume.size_bytes == 8 * (8 * 4 * 2 + 4 * 2 * 1)
    assert gpu.ledger.by_owner()["test"] == pyramid.size_bytes + volume.size_bytes
    pyramid.destroy()
    volume.destroy()


def test_bytes_of_buffers(gpu: Gpu) -> None:
    for data, size in ((np.zeros(100, np.float32), 400), (np.zeros(3, np.uint8), 16), (1000, 1000)):
        buffer = gpu.buffer("test", data, owner="test")
        assert buffer.size_bytes == size
        buffer.destroy()


def test_what_is_written_is_read(gpu: Gpu) -> None:
    rng = np.random.default_rng(1)
    image = rng.random((7, 13, 4), np.float32)
    texture = gpu.texture("test", (13, 7), "rgba32float", owner="test", data=image)
    assert np.array_equal(gpu.read_texture(texture), image)
    volume = rng.integers(0, 2**32, (5, 7, 13, 1), np.uint32)
    voxels = gpu.texture("test", (13, 7, 5), "r32uint", owner="test", dimension="3d", data=volume)
    assert np.array_equal(gpu.read_texture(voxels), volume)
    words = rng.integers(0, 2**32, 1001, np.uint32)
    buffer = gpu.buffer("test", words, owner="test")
    gpu.write(buffer, words[:2], 8)
    assert np.array_equal(gpu.read_buffer(buffer), np.concatenate([words[:2], words[:2], words[4:]]))
    for resource in (texture, voxels, buffer):
        resource.destroy()


def test_passes_are_named_and_timed_in_order(gpu: Gpu) -> None:
    with Renderer(
        LIT_WALL, (64, 48), gpu=gpu, volumetric="march", antialiasing="taa", tonemap="aces", shadow=ShadowMap(size=64)
    ) as renderer:
        for _ in range(2):
            renderer.draw()
        timed = gpu.timings()
        summed = renderer.timings()
    if not timed:
        pytest.skip("this adapter has no timestamp queries")
    names = [name for name, _ in timed]
    assert names == [
        "gbuffer.mesh",
        "shadow.shadow_map",
        "lighting",
        "volumetric.march.march",
        "composite",
        "antialiasing.taa.resolve",
        "tonemap.aces.aces",
        "frame",
    ]
    times = dict(timed)
    assert summed == times
    assert all(t >= 0 for t in times.values())
    assert times["frame"] > 0
    whole = times.pop("frame")
    assert max(times.values()) <= whole * 1.001
    assert sum(times.values()) <= whole * 1.5 + 0.05, "passes do not overlap much"
    assert times["volumetric.march.march"] == max(times.values()), "128 steps a pixel are the most work here"


def test_passes_of_one_name_are_added_up(gpu: Gpu) -> None:
    lights = [PointLight((0, 0, 0), 1.0)]
    with Renderer(
        LIT_WALL.with_(lights=lights), props.TINY, gpu=gpu, volumetric="off", shadow=ShadowMap(size=64)
    ) as renderer:
        renderer.draw()
        timed = gpu.timings()
        if not timed:
            pytest.skip("this adapter has no timestamp queries")
        parts = [t for name, t in timed if name == "shadow.shadow_map"]
        assert len(parts) == 6
        assert renderer.timings()["shadow.shadow_map"] == pytest.approx(sum(parts))


def test_resources_are_in_the_ledger_by_name(gpu: Gpu) -> None:
    with Renderer(LIT_WALL, props.TINY, gpu=gpu, volumetric="froxel", shadow=ShadowMap(size=64)) as renderer:
        renderer.draw()
        labels = {label for _, label, _ in gpu.ledger}
    assert {"frame.depth", "volumetric.froxel.scattering", "shadow.shadow_map.maps", "mesh.positions"} <= labels


def test_nothing_is_left_when_renderers_and_device_close() -> None:
    small = {"froxel": {"grid": (8, 6, 4)}}
    with Gpu() as gpu:
        with Renderer(LIT_WALL, props.TINY, gpu=gpu, volumetric="off", shadow=ShadowMap(size=64)) as renderer:
            for name in FAMILIES["volumetric"].members:
                renderer.use("volumetric", FAMILIES["volumetric"].make(name, changes=small.get(name)))
                renderer.draw()
            assert {"frame", "mesh", "shadow.shadow_map"} <= renderer.memory().keys()
        assert gpu.ledger.by_owner().keys() <= {"constants", "timers"}, "these live as long as the device"
        assert (gpu.ledger.by_owner().get("timers", 0) > 0) == ("timestamp-query" in gpu.features)
    assert list(gpu.ledger) == []
    assert gpu.ledger.total == 0


def test_a_renderer_closes_the_device_that_it_made() -> None:
    with Renderer(LIT_WALL, props.TINY, volumetric="off", shadow=ShadowMap(size=64)) as renderer:
        renderer.draw()
        ledger = renderer.gpu.ledger
        assert ledger.total > 0
    assert list(ledger) == []


def test_a_failed_pass_does_not_poison_the_next(gpu: Gpu) -> None:
    """A renderer that broke in the middle of a frame drops what it had recorded."""
    renderer = Renderer(LIT_WALL, props.TINY, gpu=gpu, volumetric="froxel", shadow=ShadowMap(size=64))

    def broken(*_: Any) -> Any:
        raise RuntimeError("broken")

    with renderer, pytest.MonkeyPatch.context() as patch:
        patch.setattr(FAMILIES["volumetric"].members["froxel"], "render", broken)
        with pytest.raises(RuntimeError, match="broken"):
            renderer.draw()
    assert props.shoot(gpu, LIT_WALL).base.max() > 0.1


def test_processes_share_a_machine_s_adapters_by_their_rank(monkeypatch: pytest.MonkeyPatch) -> None:
    def adapter(name: str, number: int) -> Any:
        kind = {"device": name, "vendor": "v", "backend_type": "Vulkan", "adapter_type": "DiscreteGPU"}
        return SimpleNamespace(info=kind, number=number)

    found = [adapter("A", 0), adapter("B", 1), adapter("A", 2), adapter("A", 3)]
    monkeypatch.setattr(device, "adapters", lambda: found)
    monkeypatch.delenv("TYNDALL_ADAPTER", raising=False)
    assert [a.number for a in choose_adapters()] == [0, 2, 3]
    assert [a.number for a in choose_adapters("b")] == [1]


def test_a_rank_counts_around(gpu: Gpu) -> None:
    count = len(choose_adapters(gpu.adapter_info["device"]))
    with Gpu(gpu.adapter_info["device"], rank=count + gpu.rank) as other:
        assert other.rank == gpu.rank
        assert other.adapter_info["device"] == gpu.adapter_info["device"]


def test_listing_adapters_leaves_the_environment_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    before = dict(os.environ)
    assert adapters()
    assert dict(os.environ) == before


_DOUBLE = """
import package::bindings::{values_at, doubled_at, doubled_put, count};
import package::tracing::line::line_group;
@compute @workgroup_size(8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = line_group(group) * 8u + local;
    if i < count {
        doubled_put(i, doubled_at(i) + 2u * values_at(i));
    }
}
"""


@pytest.mark.parametrize(("part_bytes", "parts"), [(1 << 20, 1), (1024, 4), (768, 8)])
def test_a_buffer_in_parts_is_one_to_the_shader(
    gpu: Gpu, monkeypatch: pytest.MonkeyPatch, part_bytes: int, parts: int
) -> None:
    """Parts are powers of two of elements; the last is shorter. Chained dispatches see each other's results."""
    monkeypatch.setattr(gpu, "part_bytes", part_bytes)
    values = np.arange(1000, dtype=np.uint32)
    with (
        gpu.buffer("values", values, owner="test") as source,
        gpu.buffer("doubled", values, owner="test") as target,
        props.module(gpu, f"double_{parts}", _DOUBLE) as path,
    ):
        assert len(target.split(write=True).bounds) == parts
        scope = {"values": source.split(), "doubled": target.split(write=True), "count": gpu.constant(1000)}
        prepared = gpu.compute("test.double", path).bind(scope).prepare()
        with gpu.chain("test.chain"):
            prepared.line(1000)
            prepared.line(1000)
        assert (gpu.read_buffer(target)[:1000] == 5 * values).all()
        assert [label for label, _ in gpu.timings()] in ([], ["test.chain", "frame"])
        gpu.forget_groups()


def test_a_line_of_more_workgroups_than_one_dimension_holds(gpu: Gpu) -> None:
    values = np.arange(8 * 70_000 + 3, dtype=np.uint32)
    with (
        gpu.buffer("values", values, owner="test") as source,
        gpu.buffer("doubled", 4 * len(values), owner="test") as target,
        props.module(gpu, "double_line", _DOUBLE) as path,
    ):
        gpu.compute("test.double", path).bind(
            values=source.split(), doubled=target.split(write=True), count=gpu.constant(len(values))
        ).dispatch_line(len(values))
        assert (gpu.read_buffer(target) == 2 * values).all()
        gpu.forget_groups()


def test_a_dispatch_beyond_the_limit_is_an_error_and_the_next_frame_is_well(gpu: Gpu) -> None:
    values = np.arange(8, dtype=np.uint32)
    with (
        gpu.buffer("values", values, owner="test") as source,
        gpu.buffer("doubled", values, owner="test") as target,
        props.module(gpu, "double_limit", _DOUBLE) as path,
    ):
        scope = {"values": source.split(), "doubled": target.split(write=True), "count": gpu.constant(8)}
        prepared = gpu.compute("test.double", path).bind(scope).prepare()
        prepared.run(1 << 20)
        with pytest.raises(wgpu.GPUError, match="dispatch group size"):
            gpu.submit()
        gpu.discard()
        prepared.run(1)
        assert (gpu.read_buffer(target)[:8] == 3 * values).all()
        gpu.forget_groups()


_COUNT = """
import package::bindings::{arguments, window};
@compute @workgroup_size(4)
fn ask(@builtin(local_invocation_index) i: u32) {
    if i < 3u {
        arguments[i] = array(3u, 2u, 1u)[i];
    }
}
@compute @workgroup_size(4)
fn count() {
    atomicAdd(&window[0], 1u);
}
"""


def test_a_shader_tells_how_many_workgroups_run(gpu: Gpu) -> None:
    """The second dispatch of a chain reads its size from what the first one wrote; it sees a window of a buffer."""
    with (
        gpu.buffer("arguments", 16, owner="test", usage="storage indirect") as arguments,
        gpu.buffer("counts", np.zeros(128, np.uint32), owner="test") as counts,
        props.module(gpu, "count_indirect", _COUNT) as path,
    ):
        window = counts.window(256, 256, "atomic<u32>", write=True)
        with gpu.chain("test.chain"):
            gpu.compute("test.ask", path, "ask").bind(arguments=arguments.read_write()).dispatch(1)
            gpu.compute("test.count", path, "count").bind(window=window).prepare().run_indirect(arguments)
        found = gpu.read_buffer(counts)
        assert found[64] == 3 * 2 * 4
        assert found.sum() == found[64]
        gpu.forget_groups()


# --- pipelines that are built side by side ------------------------------------------------------------------------


def _steps(count: int) -> str:
    return "import package::bindings::out;\n" + "".join(
        f"@compute @workgroup_size(8, 4)\n"
        f"fn step{k}(@builtin(local_invocation_index) i: u32) {{ out[i] = 3u * out[i] + {k}u; }}\n"
        for k in range(count)
    )


def _together(gpu: Gpu, path: str, names: list[str], out: Buffer) -> None:
    with gpu.together():
        for name in names:
            gpu.compute(name, path, name).bind(out=out.read_write()).dispatch(8, 4)


def _value(count: int, start: int = 0) -> int:
    value = start
    for k in range(count):
        value = (3 * value + k) % 2**32
    return value


def test_passes_recorded_together_run_in_order(gpu: Gpu) -> None:
    """Passes whose pipelines are still being built, chains and what is ready between them: as if one after another."""
    with gpu.buffer("test.out", 128, owner="test") as out, props.module(gpu, "test_together", _steps(8)) as path:
        compute = [gpu.compute(f"step {k}", path, f"step{k}").bind(out=out.read_write()) for k in range(8)]
        compute[3].prepare()  # is there before
        with gpu.together():
            gpu.clear_buffer(out)
            compute[0].dispatch(8, 4)
            with gpu.chain("chained"):
                for one in compute[1:4]:
                    one.dispatch(8, 4)
            for one in compute[4:7]:
                one.dispatch_line(8)
            prepared = compute[7].prepare()
            prepared.run(1)
            assert gpu.recording
            assert prepared.workgroup == (8, 4, 1)
        assert (gpu.read_buffer(out) == _value(8)).all()
        assert {label for label, _ in gpu.timings()} <= {"chained", "frame", *(f"step {k}" for k in range(8))}
        names = [each.label.rpartition(".")[2] for each in gpu.built[-8:]]
        assert sorted(names) == [f"step{k}" for k in range(8)]
        with gpu.together():
            prepared.run(1)
            gpu.clear_buffer(out, 64, 64)
            assert list(gpu.read_buffer(out)[::16]) == [3 * _value(8) % 2**32 + 7, 0]  # reading catches up
        gpu.forget_groups()


def test_drawing_waits_for_passes_before_it(gpu: Gpu) -> None:
    """A target is cleared after the pass that reads it, though that has no pipeline when it is recorded."""
    text = """
        import package::bindings::{out, shown};
        @compute @workgroup_size(1) fn keep() { out[0] = textureLoad(shown, vec2u(0, 0), 0).x; }
    """
    with (
        gpu.buffer("test.out", 16, owner="test", element="f32") as out,
        gpu.texture("test.target", (1, 1), "r32float", owner="test", usage="sampled target") as target,
        props.module(gpu, "test_drawn_after", text) as path,
    ):
        gpu.write_texture(target, np.full((1, 1, 1), 5, np.float32))
        with gpu.together():
            gpu.compute("keep", path, "keep").bind(out=out.read_write(), shown=target).dispatch(1)
            with gpu.render("cleared", [(target.view(), (2.0, 0, 0, 0))]) as native:
                native.set_viewport(0, 0, 1, 1, 0, 1)
        assert gpu.read_buffer(out).view(np.float32)[0] == 5
        assert gpu.read_texture(target)[0, 0, 0] == 2
        gpu.forget_groups()


def test_faults_of_shaders_built_together_are_raised_where_they_are_asked_for(gpu: Gpu) -> None:
    text = _steps(2) + "@compute @workgroup_size(1)\nfn wrong() {\n    let a = vec3f(1.0);\n    out[0] = a;\n}\n"
    with gpu.buffer("test.out", 128, owner="test") as out, props.module(gpu, "test_wrong_together", text) as path:
        gpu.write(out, np.ones(32, np.uint32))
        for _ in range(2):  # what failed is tried again
            with pytest.raises(ShaderError, match=r"^test_wrong_together\.wesl:8:5: "):
                _together(gpu, path, ["step0", "wrong", "step1"], out)
            assert not gpu.recording, "what was recorded with it is forgotten"
        assert (gpu.read_buffer(out) == 1).all()
        _together(gpu, path, ["step1"], out)
        assert (gpu.read_buffer(out) == 4).all()
        gpu.forget_groups()


def test_a_device_that_is_closed_waits_for_pipelines() -> None:
    with Gpu() as own, own.buffer("test.out", 128, owner="test") as out:
        with props.module(own, "test_closed", _steps(12)) as path, pytest.raises(ShaderError, match="nothing"):
            _together(own, path, ["nothing", *(f"step{k}" for k in range(12))], out)
        own.forget_groups()
    assert len(own.built) <= 12
    with pytest.raises(RuntimeError, match="shutdown"):
        own._builders.submit(int)


def test_threads_record_for_themselves_and_share_what_is_cached(gpu: Gpu) -> None:
    """What one discards, another still submits; what one has compiled, another finds; one of them has the timers."""
    seen: list[Any] = []
    quick: dict[str, Any] = {"volumetric": "off", "shadow": ShadowMap(size=16), "antialiasing": "none"}

    def aside() -> None:
        with gpu.aside(), Renderer(LIT_WALL, (8, 6), gpu=gpu, **quick) as renderer:
            assert not gpu.recording
            renderer.draw()
            seen.append((len(gpu._programs), gpu.timings(), renderer.radiance()))

    with Renderer(LIT_WALL, (8, 6), gpu=gpu, **quick) as renderer, gpu.buffer("b", 16, owner="test") as buffer:
        gpu.write(buffer, np.full(4, 7, np.uint32))
        for _ in range(2):  # some passes are of a first frame
            renderer.draw()
        timed = [name for name, _ in gpu.timings()]
        gpu.clear_buffer(buffer)
        thread = threading.Thread(target=aside)
        thread.start()
        thread.join()
        assert gpu.recording
        assert (gpu.read_buffer(buffer) == 0).all()
        renderer.draw()
        assert [name for name, _ in gpu.timings()] == timed
        (programs, untimed, radiance) = seen[0]
        assert programs == len(gpu._programs)
        assert untimed == []
        renderer.restart()
        renderer.draw()
        np.testing.assert_array_equal(radiance, renderer.radiance())
