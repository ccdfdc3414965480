"""Many units of work on many processes: chunks, a ledger, any `concurrent.futures` executor.

A unit is one texel or one file; units are numbered. A driver cuts the numbers into chunks that take
seconds (`sizes`), hands them to workers (`crew`: loky or a process pool here, Dask elsewhere;
`worker`: what runs there), stores what comes back and then marks it in a ledger
(`ledger`, SQLite). Whatever dies, the ledger says what is done: the same command goes on.
"""

from __future__ import annotations

from lobefit.fitting.engine.crew import Crew, DaskCrew, PoolCrew, open_crew
from lobefit.fitting.engine.driver import Progress, Status, run
from lobefit.fitting.engine.errors import EngineError
from lobefit.fitting.engine.ledger import Ledger, Row
from lobefit.fitting.engine.work import Work
from lobefit.fitting.engine.worker import Runner

__all__ = [
    "Crew",
    "DaskCrew",
    "EngineError",
    "Ledger",
    "PoolCrew",
    "Progress",
    "Row",
    "Runner",
    "Status",
    "Work",
    "open_crew",
    "run",
]
