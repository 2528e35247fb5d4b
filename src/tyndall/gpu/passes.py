"""Compute passes by the functions of wgpu-native themselves.

Theory. wgpu-py makes a descriptor, a label and an object for every pass, and a list of offsets for every bind group. In
a frame of a dozen short passes this takes a third of the host's time, several times what the library takes for the
calls.

Practice. Descriptors are made once, for each name of a pass and each place among a frame's timers, and pass encoders
are bare handles. Errors are raised as by wgpu-py, whose checked functions these are; its version is pinned for that.
"""

from __future__ import annotations

from typing import Any

from wgpu.backends.wgpu_native import _api as api

_MOST_DESCRIPTORS = 4096
_native: Any = api.libf
_unchecked: Any = api.lib  # of what is only recorded: faults in it are found when all is finished, and raised then


class Passes:
    """The compute passes of a device.

    Args:
        queries: the timers' query set; None where there is none.
    """

    def __init__(self, queries: Any) -> None:
        self._queries = queries
        self._descriptors: dict[tuple[str, int | None], Any] = {}

    def begin(self, encoder: Any, label: str, slot: int | None) -> Any:
        """A new pass in a command encoder, to be ended by :meth:`end`.

        Args:
            slot: of the query that its beginning is written to; its end is written to the one after. None: not timed.
        """
        descriptor = self._descriptors.get((label, slot))
        if descriptor is None:
            if len(self._descriptors) >= _MOST_DESCRIPTORS:
                self._descriptors.clear()
            descriptor = self._descriptors[label, slot] = self._describe(label, slot)
        return _native.wgpuCommandEncoderBeginComputePass(encoder._internal, descriptor)

    def _describe(self, label: str, slot: int | None) -> Any:
        stamps = api.ffi.NULL
        if slot is not None:
            stamps = api.new_struct_p(
                "WGPUPassTimestampWrites *",
                querySet=self._queries._internal,
                beginningOfPassWriteIndex=slot,
                endOfPassWriteIndex=slot + 1,
            )
        return api.new_struct_p(
            "WGPUComputePassDescriptor *", label=api.to_c_string_view(label), timestampWrites=stamps
        )

    def use(self, made: Any, pipeline: Any, group: Any) -> None:
        """What the next dispatches run, and on what."""
        _unchecked.wgpuComputePassEncoderSetPipeline(made, pipeline._internal)
        _unchecked.wgpuComputePassEncoderSetBindGroup(made, 0, group._internal, 0, api.ffi.NULL)

    def dispatch(self, made: Any, x: int, y: int, z: int) -> None:
        """Run that many workgroups."""
        _unchecked.wgpuComputePassEncoderDispatchWorkgroups(made, x, y, z)

    def dispatch_indirect(self, made: Any, arguments: Any, offset: int) -> None:
        """Run as many workgroups as three numbers in a native buffer say, at a byte offset."""
        _unchecked.wgpuComputePassEncoderDispatchWorkgroupsIndirect(made, arguments._internal, offset)

    def end(self, made: Any) -> None:
        """End a pass and let go of it."""
        try:
            _native.wgpuComputePassEncoderEnd(made)
        finally:
            _unchecked.wgpuComputePassEncoderRelease(made)
