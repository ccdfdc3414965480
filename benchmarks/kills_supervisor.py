"""The supervisor of `benchmarks.kills`: ``python -m benchmarks.kills_supervisor DIR WORKERS``."""

from __future__ import annotations

import sys
from pathlib import Path

from lobefit.service.settings import Settings
from lobefit.service.supervisor import Supervisor

__all__: list[str] = []

if __name__ == "__main__":
    folder, workers = Path(sys.argv[1]), int(sys.argv[2])
    supervisor = Supervisor(
        folder,
        [sys.executable, "-m", "lobefit.service.server"],
        workers=workers,
        limits=Settings.from_environment().limits,
        worker=[sys.executable, "-m", "benchmarks.kills_worker"],
    )
    sys.exit(supervisor.run())
