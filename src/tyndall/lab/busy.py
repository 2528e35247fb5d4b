"""Work that keeps a device at its clock between measured frames.

A frame that the host takes longer to record than the device to draw leaves it idle for most of the time, and a GPU
that idles lowers its clock: on a data-centre card the same pass then took between once and twice as long, from one
measurement to the next. A few milliseconds of arithmetic before each measured frame, submitted on their own and so in
no figure, hold the clock where a busy program has it.
"""

from __future__ import annotations

from tyndall.gpu.device import Gpu
from tyndall.gpu.resources import Closing

_MODULE = "package::lab::busy"
_THREADS = 1 << 19
_ROUNDS = 300_000  # dependent multiplications and additions of a thread: some milliseconds on a large GPU


class Busy(Closing):
    """Calling it submits the work. It does nothing on a processor, which has other things to do."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._works = gpu.adapter_info["adapter_type"] != "CPU"
        self._sum = gpu.buffer("busy.sum", 16, owner="busy", element="f32")

    def __call__(self) -> None:
        if self._works:
            rounds = self._gpu.constant(_ROUNDS)
            self._gpu.compute("busy", _MODULE, "work").bind(
                busy_rounds=rounds, busy_sum=self._sum.read_write()
            ).dispatch_line(_THREADS)
            self._gpu.submit()

    def close(self) -> None:
        """Free its buffer."""
        self._sum.destroy()
        self._gpu.forget_groups()
