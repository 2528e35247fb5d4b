"""Looked-up types of the driver's interface are those that cffi parses."""

from __future__ import annotations

import pytest
from cffi import FFI
from wgpu.backends.wgpu_native import ffi

from tyndall.gpu.driver_types import look_up

_HEADER = """
typedef struct Inner { uint32_t count; } Inner;
typedef struct Outer { Inner inner; Inner const * others; char const * label; } Outer;
typedef struct HiddenImpl * Hidden;
typedef const Inner ConstInner;
typedef enum Kind { Kind_A = 0, Kind_B = 1 } Kind;
typedef void (*Told)(Hidden, Kind, void *);
typedef void Raw(Hidden);
typedef uint64_t Flags;
"""
_NAMES = ("Inner", "Outer", "Hidden", "ConstInner", "Kind", "Told", "Flags", "char", "uint8_t", "uint32_t", "intptr_t")


@pytest.mark.parametrize("suffix", ["", " *", "[]", " []", " * ", " const *"])
def test_types_are_the_same(suffix: str) -> None:
    parsed, looked_up = FFI(), FFI()
    for each in (parsed, looked_up):
        each.cdef(_HEADER)
    assert look_up(looked_up)
    for name in _NAMES:
        text = f"{name}{suffix}"
        slow, quick = parsed.typeof(text), looked_up.typeof(text)
        assert str(slow) == str(quick)
        assert slow.kind == quick.kind
        if not suffix.strip().startswith("["):
            assert parsed.sizeof(text) == looked_up.sizeof(text)


def test_callbacks_are_the_same() -> None:
    parsed, looked_up = FFI(), FFI()
    for each in (parsed, looked_up):
        each.cdef(_HEADER)
    assert look_up(looked_up)
    told: list[int] = []
    for text in ("void(Hidden const *, Kind, Inner, void *, void *)", "void(Hidden, Kind, void *)", "void(void)"):
        slow, quick = parsed.callback(text, told.append), looked_up.callback(text, told.append)
        assert str(parsed.typeof(slow)) == str(looked_up.typeof(quick))
        assert [str(t) for t in parsed.typeof(slow).args] == [str(t) for t in looked_up.typeof(quick).args]
    assert looked_up.typeof(looked_up.callback("void(Hidden, Kind, void *)", print)) is looked_up.typeof("Told")


def test_what_is_not_plain_is_parsed() -> None:
    made = FFI()
    made.cdef(_HEADER)
    assert look_up(made)
    assert look_up(made)  # once is enough
    assert made.typeof("Inner const * *").item is made.typeof("Inner const *")
    assert made.typeof("void(*)(Hidden, Kind, void *)") is made.typeof("Told")
    assert made.typeof("Raw *").kind == "function"
    with pytest.raises(Exception, match="Unknown"):
        made.typeof("Unknown *")


def test_the_driver_s_own() -> None:
    assert look_up()
    types = [ffi.typeof(text) for text in ("WGPUBufferDescriptor *", "WGPUBindGroupEntry[]", "WGPUDevice")]
    assert [t.kind for t in types] == ["pointer", "array", "pointer"]
    assert types[0].item is ffi.typeof("WGPUBufferDescriptor const *").item
