"""Start-up: medians of ten fresh processes, interleaved."""

import statistics
import subprocess
import sys
import time

from common import show

COMMANDS = {
    "numpy": [sys.executable, "-c", "import numpy"],
    "tumble": [sys.executable, "-c", "import tumble; tumble.Scene"],
    "help": [sys.executable, "-m", "tumble", "--help"],
}
times: dict[str, list[float]] = {name: [] for name in COMMANDS}
for _ in range(11):
    for name, command in COMMANDS.items():
        start = time.perf_counter()
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
        times[name].append(time.perf_counter() - start)
# The first round fills the file cache.
seconds = {name: statistics.median(t[1:]) for name, t in times.items()}
show("import", "tumble", seconds["tumble"], "s", "with the engine loaded")
show("import", "import numpy", seconds["numpy"], "s", "")
show("help", "tumble --help", seconds["help"], "s", "")
show("help", "import numpy", seconds["numpy"], "s", "")
