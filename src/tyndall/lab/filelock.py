"""Advisory locks on files: one holder at a time, and a holder that dies lets go.

The system ties such a lock to the open file, so that no stale lock is left by a process that was killed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import sys
import time
from collections.abc import Iterator

from tyndall.scene.bundled.cache import directory

if sys.platform == "win32":
    import msvcrt

    _PLACE = 1 << 40  # Windows keeps others from what is locked, so a byte beyond any contents is

    def try_lock(file: int) -> bool:
        """Lock an open file, by its number, unless another process holds it."""
        os.lseek(file, _PLACE, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def try_lock(file: int) -> bool:
        """Lock an open file, by its number, unless another process holds it."""
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


@contextlib.contextmanager
def device_lock(name: str) -> Iterator[None]:
    """Wait for, and hold, the device of this name on this machine, so that what is timed runs alone on it.

    It excludes other workers of the same user that ask for it. Where the cache folder cannot be written there is no
    lock, and what runs beside a measurement disturbs it.
    """
    digest = hashlib.blake2b(f"{platform.node()} {name}".encode(), digest_size=8).hexdigest()
    try:
        folder = directory() / "locks"
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(folder / f"{digest}.lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:
        yield
        return
    try:
        while not try_lock(file):
            time.sleep(0.005)
        yield
    finally:
        os.close(file)
