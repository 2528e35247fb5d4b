"""Errors are measured in processes of their own, while the GPU draws the next technique.

FLIP and SSIM of a large picture take seconds of a core. A :class:`Judges` holds a few worker processes that know what
pictures are held against (:class:`tyndall.lab.metrics.Target`); pictures go to them through pipes, as pickles, and
:class:`tyndall.lab.metrics.Scores` come back. A worker loads numpy and the metrics, and neither wgpu nor a device.

The workers are plain subprocesses of the same interpreter rather than multiprocessing's: that would import the caller's
``__main__`` again in each of them, and so run a script without a guard, or a notebook's last cell, twice.

A worker that dies is started again and asked once more; when it dies again, its picture has no scores, but a line that
says so, and the others go on. Workers end with their parent, whatever way that ends: their input closes.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import IO, Self

from tyndall.lab.metrics import Light, Scores, Target, score

_MOST_WORKERS = 4
_PROGRAM = "from tyndall.lab.judging import serve; serve()"
_PATIENCE_S = 5.0


class _Died(Exception):  # noqa: N818 - caught here, always
    """A worker is no more; the message says how it ended."""


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Judges:
    """Worker processes that hold pictures against targets.

    Use it in a ``with`` block: leaving it ends the workers, at once where an error leaves it.

    Args:
        targets: what pictures are held against, by kind of light ("inscattered", "radiance" …).
        workers: how many processes; None leaves a core to the caller, and takes no more than four.
    """

    def __init__(self, targets: Mapping[str, Target], *, workers: int | None = None) -> None:
        self._count = workers or min(_MOST_WORKERS, max(1, cores() - 1))
        self._targets = pickle.dumps(dict(targets), pickle.HIGHEST_PROTOCOL)
        self._threads = ThreadPoolExecutor(self._count, "judge")  # each waits for one worker's answer
        self._idle: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        self._workers = [_Worker(self._targets, self._count) for _ in range(self._count)]
        for worker in self._workers:
            self._idle.put(worker)
        self._answers: dict[str, Future[dict[str, Scores] | str]] = {}
        self._closed = False

    def submit(self, label: str, pictures: Mapping[str, Light]) -> None:
        """Begin to score pictures, (H, W, 3) by kind of light, under a label of their own; returns at once."""
        self._answers[label] = self._threads.submit(self._ask, dict(pictures))

    def gather(self, progress: Callable[[float], object] | None = None) -> dict[str, dict[str, Scores] | str]:
        """Wait for everything submitted: scores by kind, or one line that says why there are none, by label.

        ``progress`` hears a fraction of 1.
        """
        found: dict[str, dict[str, Scores] | str] = {}
        for label, answer in self._answers.items():
            found[label] = answer.result()
            if progress:
                progress(len(found) / len(self._answers))
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the workers. What was not gathered is lost."""
        self._closed = True
        for worker in self._workers:
            worker.end()  # a thread that waits for its answer goes on
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.end()  # one that was being started meanwhile

    def _ask(self, pictures: Mapping[str, Light]) -> dict[str, Scores] | str:
        worker = self._idle.get()
        try:
            reason = ""
            for _ in range(2):
                if self._closed:
                    break
                try:
                    return worker.ask(pictures)
                except _Died as death:
                    reason = str(death)
            return f"the process that measures them died twice ({reason})"
        finally:
            self._idle.put(worker)


class _Worker:
    """One process, started when it is first asked, and again when asked after its death."""

    def __init__(self, targets: bytes, count: int) -> None:
        self._targets, self._count = targets, count
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, pictures: Mapping[str, Light]) -> dict[str, Scores] | str:
        """Scores by kind, or one line on why they cannot be measured.

        Raises:
            _Died: there was no answer.
        """
        try:
            new = self._process is None
            process = self._process = self._process or self._start()
            requests, answers = _pipes(process)
            if new:
                requests.write(self._targets)
            pickle.dump(pictures, requests, pickle.HIGHEST_PROTOCOL)
            requests.flush()
            answer: dict[str, Scores] | str = pickle.load(answers)
        except (OSError, EOFError, pickle.UnpicklingError, ValueError) as error:
            code = self.end(_PATIENCE_S)
            raise _Died(f"exit code {code}" if code is not None else str(error)) from error
        return answer

    def _start(self) -> subprocess.Popen[bytes]:
        threads = max(1, (cores() - 1) // self._count)  # FLIP's, which would else take every core in each worker
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        environment["OMP_NUM_THREADS"] = str(threads)
        return subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,  # an interrupt at the terminal is the parent's to handle
        )

    def end(self, patience_s: float = 0.0) -> int | None:
        """Wait that long for the process to end, then kill it; its exit code where it ended by itself."""
        process, self._process = self._process, None
        if process is None:
            return None
        code = None
        try:
            code = process.wait(patience_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for pipe in _pipes(process):
            with contextlib.suppress(OSError):  # what was not sent to the dead
                pipe.close()
        return code


def serve() -> None:
    """The worker's side: read targets, then pictures until the input ends, and write the scores of each."""
    # What a library prints must not get among the answers.
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        targets: dict[str, Target] = pickle.load(sys.stdin.buffer)
        while True:
            try:
                pictures: dict[str, Light] = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            answers.write(pickle.dumps(_scores(pictures, targets), pickle.HIGHEST_PROTOCOL))
            answers.flush()


def _scores(pictures: Mapping[str, Light], targets: Mapping[str, Target]) -> dict[str, Scores] | str:
    try:
        return {kind: score(picture, targets[kind]) for kind, picture in pictures.items()}
    except MemoryError:
        return "not enough memory"
    except ValueError as error:
        return str(error)


def _pipes(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes]]:
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout
