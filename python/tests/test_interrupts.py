"""Stop signals wait for critical sections."""

import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from runs import Tree

from tumble import Run, recorder
from tumble.interrupts import held
from tumble.run import simulate


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_is_held_is_done_before_the_stop(number: signal.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    former = signal.signal(number, stop)
    try:
        done = []
        with pytest.raises(KeyboardInterrupt), held():
            signal.raise_signal(number)
            done.append(1)
        assert done == [1] and signal.getsignal(number) is stop
        # An error within is told, and the next stop stops at once.
        with pytest.raises(OSError), held():
            signal.raise_signal(number)
            raise OSError
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        # If a signal is ignored, holding has no effect.
        signal.signal(number, signal.SIG_IGN)
        with held():
            assert signal.getsignal(number) is signal.SIG_IGN
            signal.raise_signal(number)
    finally:
        signal.signal(number, former)


@pytest.mark.parametrize("which", range(4))
def test_a_stop_while_handlers_change_leaves_none_that_swallows(which: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """After each of the four changes that holding makes, two to hold and two to let go."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    numbers = (signal.SIGTERM, signal.SIGINT)
    change = signal.signal
    former = [change(number, stop) for number in numbers]
    count = 0

    def interrupted(number: signal.Signals, handler: Any) -> Any:
        nonlocal count
        old = change(number, handler)
        count += 1
        if count == which + 1:
            signal.raise_signal(numbers[(which + 1) % 2])
            signal.raise_signal(numbers[which % 2])
        return old

    try:
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(signal, "signal", interrupted)
            with held():
                pass
        for number in numbers:
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(number)
    finally:
        for number, handler in zip(numbers, former, strict=True):
            change(number, handler)


def test_other_threads_hold_nothing() -> None:
    before = signal.getsignal(signal.SIGINT)

    def within() -> object:
        with held():
            return signal.getsignal(signal.SIGINT)

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(within).result() is before


@pytest.mark.parametrize("writer", ["write_columns", "write_checkpoint", "write_json"])
def test_a_stop_while_a_file_is_written_waits_for_the_frame(
    spring: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writer: str
) -> None:
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    write = getattr(recorder, writer)
    calls = 0

    def stopped(*arguments: object) -> None:
        nonlocal calls
        calls += 1
        if calls == 3:
            signal.raise_signal(signal.SIGINT)
        write(*arguments)

    monkeypatch.setattr(recorder, writer, stopped)
    monkeypatch.setattr(recorder, "MANIFEST_INTERVAL", 0.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            # Far more than there are before the third time: the manifest waits a hundred times as long as writing it took.
            simulate(spring | {"output": {"plot": False, "checkpoint": 1}}, tmp_path / "run", frames=100_000)
    finally:
        signal.signal(signal.SIGINT, former)
    run = Run(tmp_path / "run")
    assert run.status == "interrupted" and 1 <= run.n_frames < 100_000
    assert run.manifest["hashes"] == run.hashes
    assert run.frame(-1) and not list(run.folder.rglob("*.tmp"))
