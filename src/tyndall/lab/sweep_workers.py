"""Processes that measure the points of a sweep: one at a time each, and each may die.

A single worker is a child process that is told its tasks through a pipe. Several are workers of a Dask scheduler: one
that is started here, on the loopback interface alone and without a dashboard, with a process for each worker; or one
that exists, whose workers are used as they are. In either case only plain data travels: the point goes there, figures
come back, and the worker opens the scene and the device by itself.

Processes are started as plain subprocesses rather than by multiprocessing, which would run a script without a guard
again in each of them. They end with their parent, whatever way that ends: their input closes.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab.sweep_point import Station, attempt, attempted, close_stations

Plain = dict[str, Any]

_PATIENCE_S = 5.0
_POLL_S = 0.5
_START_S = 60.0
_CONNECT_S = 10.0
_CHILD = "from tyndall.lab.sweep_point import serve; serve()"
_DASK = "from tyndall.lab.sweep_workers import serve; serve()"


class Died(Exception):  # noqa: N818 - an event, which whoever asked deals with
    """A worker is no more; the message says how it ended."""


class SchedulerError(RuntimeError):
    """A Dask scheduler that was there is no more. One line."""


class Worker(ABC):
    """Answers one request after another; see :func:`tyndall.lab.sweep_point.attempt`."""

    @abstractmethod
    def ask(self, work: str, task: Mapping[str, Any]) -> Plain:
        """The answer to a task.

        Raises:
            Died: there is none. The next call starts anew.
        """

    @abstractmethod
    def end(self) -> None:
        """End it now, from any thread; who waits for its answer hears that it died."""


class Here(Worker):
    """This process.

    Args:
        gpu: the device to measure on; None opens one as a worker process does.
    """

    def __init__(self, gpu: Gpu | None = None) -> None:
        self._station = None if gpu is None else Station(gpu)

    def ask(self, work: str, task: Mapping[str, Any]) -> Plain:
        station = self._station
        if station is None:
            return attempt(work, task)
        return attempted(lambda: station.measure(task["point"], task["scene_hash"]))

    def end(self) -> None:
        if self._station is None:
            close_stations()
        else:
            self._station.close()


def _start(program: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    return subprocess.Popen(
        [sys.executable, "-c", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        encoding="utf-8",
        start_new_session=True,  # an interrupt at the terminal is the parent's to handle
    )


class _Process:
    """A subprocess that may be ended from any thread, and is then not started again."""

    def __init__(self, program: str) -> None:
        self._program = program
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._ended = False

    def running(self) -> subprocess.Popen[str]:
        """The process, started where there is none.

        Raises:
            Died: it was ended.
        """
        with self._lock:
            if self._ended:
                raise Died("it was ended")
            if self._process is None:
                self._process = _start(self._program)
            return self._process

    def bury(self) -> str:
        """Forget a process that gave no answer; how it ended."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return "it was ended"
        try:
            code = process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        _close_pipes(process)
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def end(self) -> None:
        """Kill it, for good."""
        with self._lock:
            self._ended = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()
                _close_pipes(self._process)


def _close_pipes(process: subprocess.Popen[str]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):  # what was not sent to the dead
                pipe.close()


class Child(Worker):
    """A child process."""

    def __init__(self) -> None:
        self._process = _Process(_CHILD)

    def ask(self, work: str, task: Mapping[str, Any]) -> Plain:
        process = self._process.running()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(json.dumps({"work": work, "task": task}) + "\n")
            process.stdin.flush()
            answer: Plain = json.loads(process.stdout.readline())
        except (OSError, ValueError) as error:  # a closed pipe, half a line
            raise Died(self._process.bury()) from error
        return answer

    def end(self) -> None:
        self._process.end()


# --- Dask ---------------------------------------------------------------------------------------------------------


def check_dask() -> None:
    """Raises ParameterError where Dask is not installed."""
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise ParameterError("several workers need Dask: pip install 'tyndall[sweep]'") from error


class _DaskWorker(Worker):
    """One worker of a scheduler, by its address."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._ended = threading.Event()

    def ask(self, work: str, task: Mapping[str, Any]) -> Plain:
        from concurrent.futures import CancelledError

        from distributed import KilledWorker

        address = self.address()
        future = self._client.submit(
            attempt, work, dict(task), workers=[address], allow_other_workers=False, pure=False, retries=0
        )
        try:
            while not self._ended.is_set():
                try:
                    answer: Plain = future.result(timeout=_POLL_S)
                    return answer
                except TimeoutError:
                    if not self.alive(address):
                        break
        except (KilledWorker, CancelledError, OSError):
            pass
        except Exception as error:  # whatever Dask could not carry or run: a worker without Tyndall, for one
            raise Died(f"{type(error).__name__}: {error}") from error
        with contextlib.suppress(Exception):
            future.cancel()
        raise Died(self.bury(address))

    def end(self) -> None:
        self._ended.set()

    @abstractmethod
    def address(self) -> str:
        """Where it is."""

    @abstractmethod
    def alive(self, address: str) -> bool:
        """Whether it still is."""

    @abstractmethod
    def bury(self, address: str) -> str:
        """Forget it; how it ended."""


class _LocalWorker(_DaskWorker):
    """A process of ours that is a worker of our scheduler."""

    def __init__(self, client: Any, scheduler: str, folder: str) -> None:
        super().__init__(client)
        self._told = json.dumps([scheduler, folder])
        self._process = _Process(_DASK)
        self._known: tuple[subprocess.Popen[str], str] | None = None

    def address(self) -> str:
        process = self._process.running()
        if self._known is None or self._known[0] is not process:
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(self._told + "\n")
                process.stdin.flush()
                address = process.stdout.readline().strip()
            except (OSError, ValueError):
                address = ""
            if not address:
                raise Died(self._process.bury())
            self._known = process, address
        return self._known[1]

    def alive(self, address: str) -> bool:
        return self._known is not None and self._known[0].poll() is None

    def bury(self, address: str) -> str:
        self._known = None
        return self._process.bury()

    def end(self) -> None:
        super().end()
        self._process.end()


class _RemoteWorker(_DaskWorker):
    """A worker of a scheduler that exists. When it dies, whoever takes its place there takes it here."""

    def __init__(self, cluster: _Remote, address: str) -> None:
        super().__init__(cluster.client)
        self._cluster = cluster
        self._address: str | None = address

    def address(self) -> str:
        if self._address is None:
            self._address = self._cluster.free(self._ended)
        return self._address

    def alive(self, address: str) -> bool:
        return address in self._cluster.addresses()

    def bury(self, address: str) -> str:
        self._cluster.addresses()  # where the scheduler itself is gone, no worker is to blame
        self._cluster.taken.discard(address)
        self._address = None
        return f"{address} is gone"


class _Remote:
    """The workers of a scheduler that exists."""

    def __init__(self, client: Any, address: str) -> None:
        self.client, self._address = client, address
        self.taken: set[str] = set()
        self._lock = threading.Lock()

    def addresses(self) -> list[str]:
        """Of the workers that are there now.

        Raises:
            SchedulerError: there is nobody to tell.
        """
        with contextlib.suppress(OSError, ValueError):
            known = self.client.scheduler_info(n_workers=-1).get("workers")
            if known is not None and self.client.status == "running":
                return list(known)
        raise SchedulerError(f"scheduler: {self._address} does not answer any more; what was measured is kept")

    def take(self) -> str | None:
        """An address that nobody has."""
        with self._lock:
            address = next((a for a in self.addresses() if a not in self.taken), None)
            if address is not None:
                self.taken.add(address)
            return address

    def free(self, ended: threading.Event) -> str:
        """Wait for a worker that nobody has.

        Raises:
            Died: none came.
        """
        for _ in range(int(_START_S / _POLL_S)):
            if (address := self.take()) is not None:
                return address
            if ended.wait(_POLL_S):
                break
        raise Died("no worker took its place")


@contextlib.contextmanager
def local_workers(count: int) -> Iterator[list[tuple[Worker, int]]]:
    """Workers of a Dask scheduler of our own, each with its rank among them."""
    import dask
    import distributed

    parts: Any = distributed  # whose constructors have no types
    settings = {
        "distributed.scheduler.allowed-failures": 0,  # a point is retried by us, and once
        "distributed.scheduler.http.routes": [],
        "distributed.admin.tick.interval": "1h",
        "distributed.comm.timeouts.connect": "30s",
    }
    with contextlib.ExitStack() as stack:
        # Dask's own files, ours to remove, since workers are killed.
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="tyndall-", ignore_cleanup_errors=True))
        stack.enter_context(dask.config.set({**settings, "temporary-directory": folder}))
        # Zero workers of its own; what would be its dashboard answers nothing, on a port of the loopback interface.
        cluster = stack.enter_context(
            parts.LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address=None,
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                silence_logs="critical",
            )
        )
        client = stack.enter_context(parts.Client(cluster, set_as_default=False))
        workers = [_LocalWorker(client, cluster.scheduler_address, folder) for _ in range(count)]
        for worker in workers:
            stack.callback(worker.end)
        yield list(zip(workers, itertools.count()))


@contextlib.contextmanager
def remote_workers(address: str) -> Iterator[list[tuple[Worker, int]]]:
    """The workers of the Dask scheduler at an address, each with its rank on its host.

    Raises:
        ParameterError: no scheduler answers there, or it has no workers.
    """
    import distributed

    parts: Any = distributed  # whose constructors have no types
    with contextlib.ExitStack() as stack:
        log = logging.getLogger("distributed.client")
        stack.callback(log.setLevel, log.level)
        log.setLevel(logging.CRITICAL + 1)  # what it reports of a lost scheduler is told by us, in a line
        try:
            client = stack.enter_context(parts.Client(address, timeout=_CONNECT_S, set_as_default=False))
        except (OSError, ValueError, TypeError) as error:
            raise ParameterError(f"scheduler: no Dask scheduler answers at {address}") from error
        remote = _Remote(client, address)
        hosts: Counter[str] = Counter()
        workers: list[tuple[Worker, int]] = []
        while (one := remote.take()) is not None:
            host = one.rpartition("//")[2].rpartition(":")[0]
            worker = _RemoteWorker(remote, one)
            stack.callback(worker.end)
            workers.append((worker, hosts[host]))
            hosts[host] += 1
        if not workers:
            raise ParameterError(f"scheduler: {address} has no workers")
        yield workers


def serve() -> None:
    """The side of a process of :func:`local_workers`: reads the scheduler's address and a folder, writes its address,
    and works."""
    scheduler, folder = json.loads(sys.stdin.readline())
    end_with_parent(folder)

    async def work() -> None:
        import dask
        import distributed

        parts: Any = distributed

        with dask.config.set({"distributed.worker.http.routes": []}):
            process = parts.Worker(
                scheduler,
                nthreads=1,
                host="127.0.0.1",
                dashboard=False,
                dashboard_address="127.0.0.1:0",
                local_directory=folder,
                memory_limit=0,
            )
        async with process:
            print(process.address, flush=True)
            await process.finished()

    asyncio.run(work())


def end_with_parent(folder: str) -> None:
    """End this process when its input closes, at once, and remove a folder: they are of use to nobody then."""

    def wait() -> None:
        sys.stdin.read()
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
