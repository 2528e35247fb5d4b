"""One device for all tests of a worker: making a device and compiling shaders are the slow parts."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tyndall.gpu.device import Gpu


@pytest.fixture(scope="session")
def gpu() -> Iterator[Gpu]:
    """The device; what a test makes on it, the test destroys."""
    with Gpu() as device:
        yield device


@pytest.fixture
def software(gpu: Gpu) -> Gpu:
    """The device where it is Mesa's software adapter, on which pictures are the same everywhere."""
    if "llvmpipe" not in gpu.adapter_info["device"]:
        pytest.skip(f"pictures are compared on llvmpipe only; this is {gpu.adapter_info['device']}")
    return gpu
