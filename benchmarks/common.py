"""What the cases share."""

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
