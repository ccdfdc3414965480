"""Time and memory of reading a large table, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

SMALL = "theta_i,phi_i,theta_o,phi_o,R\n" + "".join(f"10,0,{k}0,0,1\n" for k in range(1, 7))

LOAD = """
import resource, sys
from lobefit.fitting.readers import read_measurement
read_measurement(sys.argv[1])
before = resource.getrusage(resource.RUSAGE_SELF)
made = read_measurement(sys.argv[2])
after = resource.getrusage(resource.RUSAGE_SELF)
seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
print(made.n_directions, seconds, (after.ru_maxrss - before.ru_maxrss) / 1024)
"""


def test_time_and_memory_stay_in_proportion_to_the_table(tmp_path: Path) -> None:
    """A fifth of the million rows that take 2.2 s and 105 MiB; bounds with room for a busy machine."""
    n = 200_000
    rng = np.random.default_rng(1)
    columns = [rng.uniform(0, top, n) for top in (80, 360, 85, 360)]
    columns += list(10 ** rng.uniform(-4, 2, (3, n)))
    form = "%.9g,%.9g,%.9g,%.9g,%.7g,%.7g,%.7g"
    rows = "\n".join(form % row for row in zip(*(c.tolist() for c in columns), strict=True))
    large, small = tmp_path / "large.csv", tmp_path / "small.csv"
    large.write_text(f"theta_i,phi_i,theta_o,phi_o,R,G,B\n{rows}\n")
    small.write_text(SMALL)
    command = [sys.executable, "-c", LOAD, str(small), str(large)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    read, seconds, mebibytes = done.stdout.split()
    assert int(read) == n
    assert float(mebibytes) < 40  # 11 MiB of numbers, twice for the copy, and blocks
    assert float(seconds) < 2.5
