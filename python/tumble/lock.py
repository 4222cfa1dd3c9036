"""One process writes into a run folder at a time.

The lock is the system's, on a file that says who holds it: it ends with the process, however that ends. Where the system has
none, as Windows and some network disks, nobody is kept away.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tumble.folder import LOCK, reason, refuse

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keeps other processes from writing there until the end of the block; makes the folder, and takes it away if it stays
    empty. Raises SceneError if it cannot be made, or if somebody writes there."""
    made = _make(folder)
    handle = None
    try:
        handle = _locked(folder, os.O_CREAT)
        yield
    finally:
        if handle is not None:
            # Before the lock is given up: who has opened this file by then sees that it is gone.
            with suppress(OSError):
                (folder / LOCK).unlink()
            os.close(handle)
        for empty in made:
            with suppress(OSError):
                empty.rmdir()


def ask(folder: Path) -> None:
    """Raises SceneError if somebody writes there."""
    try:
        there = (folder / LOCK).exists()
    except OSError:
        return
    handle = _locked(folder, 0) if there else None
    if handle is not None:
        os.close(handle)


def _make(folder: Path) -> list[Path]:
    """Makes a folder; returns what was not there before, innermost first."""
    missing = []
    try:
        for path in [folder, *folder.parents]:
            if os.path.lexists(path):
                break
            missing.append(path)
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refuse(folder, reason(error)) from error
    return missing


def _locked(folder: Path, create: int) -> int | None:
    """The file, open and locked; None where there are no locks."""
    if fcntl is None:
        return None
    while True:
        try:
            handle = os.open(folder / LOCK, os.O_RDWR | create, 0o666)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise refuse(folder, reason(error)) from error
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is(handle, folder / LOCK):
                os.ftruncate(handle, 0)
                os.write(handle, str(os.getpid()).encode())
                return handle
        except BlockingIOError:
            number = os.pread(handle, 20, 0).decode(errors="replace")
            os.close(handle)
            whose = f" (pid {number})" if number.isdigit() else ""
            text = f"a run is writing here{whose}; wait for it or stop it, or choose another folder with --out"
            raise refuse(folder, text) from None
        except OSError:
            os.close(handle)
            return None
        os.close(handle)


def _is(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
