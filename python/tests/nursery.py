"""Scenes in processes of their own: `python nursery.py` waits for scenes and forks for each, so that a case costs no start of
Python, takes nothing with it when it dies, and its memory is its own.

A line of JSON in, and one out: see `Nursery.ask`.
"""

import json
import os
import resource
import select
import signal
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Any, Self

PATIENCE = (5, 120)
"""Seconds after which a case is asked to stop, as by Ctrl-C, and then until it counts as one that hangs. Steps heed it at once;
building
a scene ends first, which takes a few seconds at most."""

ROOM = 12 << 30
"""Bytes of addresses that a case may have."""


class Nursery:
    """The process that forks."""

    def __enter__(self) -> Self:
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1]), "OMP_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()

    def ask(
        self, tree: Any, folder: str = ".", frames: int = 1, probe: bool = False, patience: float = PATIENCE[0]
    ) -> dict[str, Any]:
        """Outcome of a scene in its first frames, or if it is only probed, before them.

        `end` is refused, built, broke, stopped, raised, died or hangs.
        """
        assert self.process.stdin is not None and self.process.stdout is not None
        line = {"tree": tree, "folder": folder, "frames": frames, "probe": probe, "patience": patience}
        self.process.stdin.write(json.dumps(line) + "\n")
        self.process.stdin.flush()
        answer: dict[str, Any] = json.loads(self.process.stdout.readline())
        return answer


def status(key: str) -> int:
    """A line of /proc/self/status [bytes]; 0 where there is none."""
    try:
        with open("/proc/self/status") as lines:  # noqa: PTH123 (as few allocations as can be)
            return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key))
    except (OSError, StopIteration):
        return 0


def live(task: dict[str, Any]) -> dict[str, Any]:
    """A case, in its own process."""
    import numpy as np

    from tumble import Scene, SceneError, StepError, World

    before = status("VmRSS:")
    answer: dict[str, Any] = {"issues": []}
    try:
        scene = Scene(task["tree"], task["folder"])
        answer["estimate"] = scene.memory
        world = World(scene)
        answer["end"] = "built"
        if task["probe"]:
            return answer
        world.step(task["frames"])
        # Gates that nobody has crossed have no times.
        known = [(k, c) for table in world.frame.values() for k, c in table.items() if k != "crossing_times"]
        found = [c for _, c in known if c.dtype.kind == "f"]
        answer["finite"] = all(np.isfinite(array).all() for array in found)
        answer["hash"] = world.hash()
        answer["energy"] = str(world.ledger["energy"])
    except SceneError as error:
        answer |= {"end": "refused", "issues": error.issues, "text": str(error)}
    except StepError as error:
        answer |= {"end": "broke", "text": str(error), "report": str(error.report)}
    except KeyboardInterrupt:
        answer["end"] = "stopped"
    except BaseException as error:
        answer |= {"end": "raised", "text": f"{type(error).__name__}: {error}"}
    answer["taken"] = max(status("VmHWM:") - before, 0)
    return answer


def main() -> None:
    import numpy  # noqa: F401

    import tumble  # noqa: F401

    # Whoever starts tests in the background may have left it ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for line in sys.stdin:
        task = json.loads(line)
        patience = (task["patience"], PATIENCE[1])
        back, forth = os.pipe()
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_AS, (ROOM, ROOM))
            os.close(back)
            answer = json.dumps(live(task)).encode()
            with os.fdopen(forth, "wb") as pipe:
                pipe.write(answer)
            os._exit(0)
        os.close(forth)
        said, waits, hangs = b"", 0, False
        while True:
            if not select.select([back], [], [], patience[min(waits, 1)])[0]:
                hangs = waits > 0
                os.kill(child, signal.SIGKILL if hangs else signal.SIGINT)
                waits += 1
                continue
            if not (part := os.read(back, 1 << 16)):
                break
            said += part
        os.close(back)
        _, code = os.waitpid(child, 0)
        if hangs or code != 0:
            said = json.dumps(
                {"end": "hangs" if hangs else "died", "issues": [], "text": f"status {code}", "taken": 0}
            ).encode()
        print(said.decode(), flush=True)


if __name__ == "__main__":
    main()
