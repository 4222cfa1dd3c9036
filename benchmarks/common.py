"""Helpers of the cases."""

import json
import statistics
import sys
import time
from collections.abc import Callable

THREADS = int(sys.argv[1]) if len(sys.argv) > 1 else 1


def median(work: Callable[[], object], repeats: int = 5) -> float:
    """Median wall time of a call [s], after one to warm up."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def show(case: str, who: str, value: float, unit: str, check: str) -> None:
    """One line of the table."""
    print(
        json.dumps({"case": case, "who": who, "threads": THREADS, "value": value, "unit": unit, "check": check}),
        flush=True,
    )


def triad() -> float:
    """Bytes a second of a = b + s c, without non-temporal stores."""
    import numba
    import numpy as np

    numba.set_num_threads(THREADS)

    @numba.njit(parallel=True, fastmath=True)
    def run(a, b, c):  # type: ignore[no-untyped-def]
        for i in numba.prange(len(a)):
            a[i] = b[i] + 3.0 * c[i]

    a, b, c = (np.ones(20_000_000) for _ in range(3))
    return 24 * len(a) / median(lambda: run(a, b, c))
