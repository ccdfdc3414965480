"""The service under load: how fast, how much memory, and what it does with what is not well meant.

``python -m benchmarks.service latency --uploads 50`` (cold start, idle memory, CSV to report)
``python -m benchmarks.service throughput --fits 1000`` (2 workers, 16 clients, memory over time)
``python -m benchmarks.service half-open --connections 400`` (/healthz beside them)
``python -m benchmarks.service uploads --clients 50 --mib 10`` (at once)
``python -m benchmarks.service mutate --cases 5000`` (damaged files, from ../shared/data or samples)
``python -m benchmarks.service schemathesis --cases 2000``

Each starts a service of its own on a free port of this machine, and prints what it counted.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import httpx2

from benchmarks.mutations import mutations
from benchmarks.served import quantile, served

__all__ = ["main"]

CSV = {"Content-Type": "text/csv"}
# 2,000 rows of 3 channels: 40 incidences times 50 directions in the plane of incidence.
GEOMETRY = "in-plane incidences={} step=3"


def measurement(client: httpx2.Client, seed: int) -> bytes:
    """Simulate a CSV of 2,000 rows and 3 channels with noise of its own."""
    body = {
        "model": "ggx",
        "params": {"k_d": [0.2, 0.15, 0.1], "k_s": 0.9, "F0": [0.5, 0.4, 0.3], "alpha": 0.25},
        "geometry": GEOMETRY.format(",".join(f"{2 * k}" for k in range(40))),
        "noise": [0.02, 0.001],
        "seed": seed,
    }
    answer = client.post("/v1/simulate", json=body)
    answer.raise_for_status()
    lines = answer.text.splitlines(keepends=True)
    head = next(k for k, line in enumerate(lines) if line[0].isalpha())
    return "".join(lines[: head + 1 + 2000]).encode()


def fitted(
    client: httpx2.Client, data: bytes, reported: Callable[[], None] | None = None, **body: Any
) -> dict[str, Any]:
    """Upload and fit; give the fit when it has ended. `reported` is called once the report is there."""
    while (
        found := client.post("/v1/measurements", content=data, headers=CSV)
    ).status_code == 429:  # too many at once
        time.sleep(0.1)
    found.raise_for_status()
    made = client.post("/v1/fits", json={"measurement": found.json()["id"], **body})
    made.raise_for_status()
    id = made.json()["id"]
    if reported is not None:  # the report comes before the pictures
        while client.get(f"/v1/fits/{id}/artefacts/report.json").status_code != 200:
            time.sleep(0.01)
        reported()
    with client.stream("GET", f"/v1/fits/{id}/events") as events:
        for _ in events.iter_bytes():
            pass
    fit: dict[str, Any] = client.get(f"/v1/fits/{id}").json()
    if fit["state"] != "done":
        raise RuntimeError(f"the fit ended as {fit['state']}: {fit['problem']}")
    return fit


def latency(given: argparse.Namespace) -> dict[str, Any]:
    """Time from the POST of a CSV to the complete report, one after the other."""
    with served() as service, service.client() as client:
        time.sleep(2)
        idle = service.memory()
        data = [measurement(client, seed) for seed in range(given.uploads + 3)]
        seconds, reports, best = [], [], Counter[str]()
        for k, body in enumerate(data):
            start = time.perf_counter()
            fit = fitted(client, body, lambda: reports.append(time.perf_counter() - start))  # noqa: B023 - called at once
            seconds.append(time.perf_counter() - start)
            best[fit["best"]] += 1
            if k == 0:
                rows = fit["result"]["measurement"]
        warm, told = seconds[3:], reports[3:]
        return {
            "answers s": round(service.answers, 2),
            "ready s": round(service.ready, 2),
            "idle MiB": {name: round(v, 1) for name, v in idle.items()},
            "after MiB": {name: round(v, 1) for name, v in service.memory().items()},
            "measurement": {key: rows.get(key) for key in ("rows", "channels")},
            "first s": round(seconds[0], 3),
            "report: median s": round(quantile(told, 0.5), 3),
            "report: p95 s": round(quantile(told, 0.95), 3),
            "with pictures: median s": round(quantile(warm, 0.5), 3),
            "with pictures: p95 s": round(quantile(warm, 0.95), 3),
            "count": len(warm),
            "best": dict(best),
            "tracebacks": service.tracebacks(),
        }


def throughput(given: argparse.Namespace) -> dict[str, Any]:
    """Fits per second of many clients, and memory while they go on."""
    with served("--workers", str(given.workers)) as service, service.client() as client:
        data = [measurement(client, seed) for seed in range(8)]
        memory: list[dict[str, float]] = []
        lock, done = threading.Lock(), 0

        def one(k: int) -> None:
            nonlocal done
            fitted(client, data[k % len(data)], seed=k, models=given.models)
            with lock:
                done += 1
                if done % max(1, given.fits // 10) == 0:
                    memory.append({"fits": done, **service.memory()})

        start = time.perf_counter()
        with ThreadPoolExecutor(given.clients) as pool:
            list(pool.map(one, range(given.fits)))
        seconds = time.perf_counter() - start
        return {
            "fits": given.fits,
            "fits per s": round(given.fits / seconds, 2),
            "MiB": [{name: round(v, 1) for name, v in row.items()} for row in memory],
            "tracebacks": service.tracebacks(),
        }


def half_open(given: argparse.Namespace) -> dict[str, Any]:
    """Ask /healthz on new connections while others have sent half a head."""
    with served() as service:
        host, port = service.url.removeprefix("http://").rsplit(":", 1)
        held = []
        for _ in range(given.connections):
            held.append(socket.create_connection((host, int(port))))
            held[-1].sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Half: ")
        seconds, start = [], time.perf_counter()
        while time.perf_counter() - start < given.seconds:
            asked = time.perf_counter()
            # A new connection each time; a whole client would cost more than the answer.
            connection = HTTPConnection(host, int(port), timeout=60)
            connection.request("GET", "/healthz")
            if connection.getresponse().read() != b'{"status":"ok"}':
                raise RuntimeError("/healthz does not say ok")
            connection.close()
            seconds.append(time.perf_counter() - asked)
            time.sleep(0.01)
        closed = 0
        for half in held:
            half.setblocking(False)
            try:
                closed += half.recv(1) == b""
            except BlockingIOError:
                pass
            except OSError:
                closed += 1
            half.close()
        return {
            "connections": given.connections,
            "closed by the server": closed,
            "asked": len(seconds),
            "median ms": round(1e3 * quantile(seconds, 0.5), 2),
            "p99 ms": round(1e3 * quantile(seconds, 0.99), 2),
            "MiB": {name: round(v, 1) for name, v in service.memory().items()},
        }


def uploads(given: argparse.Namespace) -> dict[str, Any]:
    """Many clients upload large files at once, and come again where they are told to."""
    # Incidences of 1,000 views each, all different.
    lines = given.mib * (1 << 20) // len(b"80.000,0,89.000,180,0.123456789012345678\n")
    body = b"theta_i,phi_i,theta_o,phi_o,brdf\n" + b"".join(
        b"%.3f,0,%.3f,180,0.123456789012345678\n"
        % (80 * (k // 1000) / (lines // 1000), k % 1000 * 0.089)
        for k in range(lines)
    )
    with served() as service:
        before = service.memory()
        peak = dict(before)
        ended, lock = threading.Event(), threading.Lock()

        def watch() -> None:
            while not ended.wait(0.05):
                for name, value in service.memory().items():
                    peak[name] = max(value, peak.get(name, 0.0))

        answers: Counter[str] = Counter()

        def one(k: int) -> None:
            with service.client() as client:
                for _ in range(1000):
                    try:
                        answer = client.post(
                            "/v1/measurements", content=b"# client: %d\n" % k + body, headers=CSV
                        )
                        said = f"{answer.status_code} {answer.headers['content-type']}"
                        wait = float(answer.headers.get("retry-after", 0))
                    except httpx2.TransportError as error:
                        said, wait = type(error).__name__, 1.0
                    with lock:
                        answers[said] += 1
                    if not wait:
                        return
                    time.sleep(wait)

        watcher = threading.Thread(target=watch)
        watcher.start()
        start = time.perf_counter()
        with ThreadPoolExecutor(given.clients) as pool:
            list(pool.map(one, range(given.clients)))
        seconds = time.perf_counter() - start
        ended.set()
        watcher.join()
        return {
            "clients": given.clients,
            "bytes each": len(body),
            "answers": dict(answers),
            "seconds": round(seconds, 1),
            "before MiB": {name: round(v, 1) for name, v in before.items()},
            "peak MiB": {name: round(v, 1) for name, v in peak.items()},
            "tracebacks": service.tracebacks(),
        }


def mutate(given: argparse.Namespace) -> dict[str, Any]:
    """Upload damaged files; every refusal must name a cause."""
    statuses: Counter[str] = Counter()
    nameless: list[str] = []
    lock = threading.Lock()
    with served("--workers", "1") as service, service.client() as client:

        def one(case: tuple[str, bytes]) -> None:
            what, body = case
            answer = client.post("/v1/measurements", content=body, headers=CSV)
            if answer.status_code == 201:
                client.delete(answer.headers["location"])
            with lock:
                slug = ""
                if answer.status_code >= 400:
                    document = answer.json()
                    slug = " " + document["type"].rpartition("/")[2]
                    if answer.status_code >= 500 or len(document.get("detail", "")) < 10:
                        nameless.append(f"{what}: {answer.status_code} {document}")
                statuses[f"{answer.status_code}{slug}"] += 1

        start = time.perf_counter()
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(one, mutations(given.cases, given.seed)))
        return {
            "cases": given.cases,
            "seconds": round(time.perf_counter() - start, 1),
            "answers": dict(statuses),
            "500 and up, or without a cause": nameless[:20],
            "tracebacks": service.tracebacks(),
            "MiB": {name: round(v, 1) for name, v in service.memory().items()},
        }


def schemathesis(given: argparse.Namespace) -> dict[str, Any]:
    """Let schemathesis make requests from the OpenAPI document, on a store with something in it."""
    program = Path(sys.executable).with_name("schemathesis")
    with served("--workers", "1") as service, service.client() as client:
        fit = fitted(client, measurement(client, 1), models="quick")
        operations = sum(len(m) for m in client.get("/openapi.json").json()["paths"].values())
        before = answered(client)
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                [
                    *(program, "run", f"{service.url}/openapi.json", "--no-color"),
                    *("--max-examples", str(max(1, given.cases // operations))),
                    # That any text is a CSV and any name a model, no schema can deny; that
                    # a token may be left out is right on loopback.
                    *("--checks", "all"),
                    *("--exclude-checks", "positive_data_acceptance,ignored_auth"),
                    *("--seed", str(given.seed), "--continue-on-failure"),
                    *("--request-timeout", "60", "--suppress-health-check", "all"),
                ],
                cwd=folder,
                env={
                    **os.environ,
                    "PYTHONPATH": str(Path(__file__).parents[1]),
                    "SCHEMATHESIS_HOOKS": "benchmarks.schemathesis_hooks",
                    "LOBEFIT_FIT": fit["id"],
                    "LOBEFIT_MEASUREMENT": fit["measurement"],
                },
                capture_output=True,
                text=True,
                check=False,
            )
        print(done.stdout[-given.tail :], done.stderr[-given.tail :])
        answers = answered(client) - before
        cases = re.search(r"(\d+) generated", done.stdout)
        return {
            "exit status": done.returncode,
            "cases": int(cases[1]) if cases else None,
            "requests": answers.total(),
            "answers": dict(sorted(answers.items())),
            "500 and up": sum(n for status, n in answers.items() if status >= "500"),
            "tracebacks": service.tracebacks(),
        }


def answered(client: httpx2.Client) -> Counter[str]:
    """Count the service's answers so far by status."""
    found: Counter[str] = Counter()
    for status, count in re.findall(
        r'^lobefit_http_requests_total\{.*status="(\d+)"\} (\S+)',
        client.get("/metrics").text,
        re.MULTILINE,
    ):
        found[status] += int(float(count))
    return found


def main() -> None:
    """Run one of the benchmarks."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.service", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    def command(name: str, run: Callable[[argparse.Namespace], dict[str, Any]]) -> Any:
        made = commands.add_parser(name, help=run.__doc__)
        made.set_defaults(run=run)
        made.add_argument("--seed", type=int, default=0)
        return made

    command("latency", latency).add_argument("--uploads", type=int, default=50)
    made = command("throughput", throughput)
    made.add_argument("--fits", type=int, default=1000)
    made.add_argument("--workers", type=int, default=2)
    made.add_argument("--clients", type=int, default=16)
    made.add_argument("--models", default="standard")
    made = command("half-open", half_open)
    made.add_argument("--connections", type=int, default=400)
    made.add_argument("--seconds", type=float, default=12.0)
    made = command("uploads", uploads)
    made.add_argument("--clients", type=int, default=50)
    made.add_argument("--mib", type=int, default=10)
    command("mutate", mutate).add_argument("--cases", type=int, default=5000)
    made = command("schemathesis", schemathesis)
    made.add_argument("--cases", type=int, default=2000)
    made.add_argument("--tail", type=int, default=6000)
    given = parser.parse_args()
    print(json.dumps(given.run(given), indent=1))


if __name__ == "__main__":
    main()
