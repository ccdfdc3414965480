"""Scenes: what the cheapest sufficient model and shading is, and how long the decision takes.

    python -m benchmarks.scene [NAME ...] [--out DIR]

For each scene of ``samples/scenes``: its surface is measured (simulated from NAME.surface.json),
the candidates that the scene names are fitted, and `lobefit.fitting.decide` answers for the scene's
tolerance, for a tenth and for ten times of it. Then the decision that a user waits for: a sphere
of 512 x 512 pixels under two lamps, twelve models flat, Gouraud and Phong, in this process's first
and second go (the first compiles what the runtime's cache does not have).
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.timing import machine
from lobefit.fitting import Decision, decide, fit
from samples.make import measure

__all__ = ["SCENES", "fitted", "run", "table"]

SCENES = Path(__file__).parents[1] / "samples" / "scenes"
TWELVE = (
    *("lambert", "oren_nayar", "phong", "modified_phong", "blinn_phong", "ward"),
    *("cook_torrance", "beckmann", "ggx", "ggx_anisotropic", "student_t", "ggx+ggx"),
)


def names() -> list[str]:
    """List the scenes."""
    return sorted(p.stem for p in SCENES.glob("*.json") if not p.stem.endswith(".surface"))


def fitted(name: str, folder: Path, models: tuple[str, ...] = ()) -> Path:
    """Measure the surface of a scene and fit models, by default the scene's; give the folder."""
    spec = json.loads((SCENES / f"{name}.surface.json").read_text(encoding="utf-8"))
    scene = json.loads((SCENES / f"{name}.json").read_text(encoding="utf-8"))
    wanted = models or tuple(scene["models"])
    fit(measure(spec), models=list(wanted)).save(folder)
    return folder


def _twelve(folder: Path) -> list[dict[str, float]]:
    """Time the decision of 512 x 512 pixels, twice."""
    report = fitted("plastic_in_showroom", folder / "fit", TWELVE)
    scene = json.loads((SCENES / "painted_ball.json").read_text(encoding="utf-8"))
    scene["view"] |= {"width": 512, "height": 512}
    scene["models"] = list(TWELVE)
    path = folder / "scene.json"
    path.write_text(json.dumps(scene), encoding="utf-8")
    found = []
    for _ in range(2):
        start, busy = time.perf_counter(), time.process_time()
        decision = decide(path, report)
        assert len(decision.combinations) == 3 * len(TWELVE)
        seconds = time.perf_counter() - start
        found.append({"seconds": seconds, "cpu_seconds": time.process_time() - busy})
    return found


def run(which: list[str], out: Path) -> dict[str, Any]:
    """Decide every scene; returns a JSON-able record."""
    decided: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as temporary:
        first = _twelve(Path(temporary))
        for name in which or names():
            decision = decide(SCENES / f"{name}.json", fitted(name, Path(temporary) / name))
            decision.save(out / name)
            print(f"\n{name}: {decision.sentence}\n{decision.reference.why}")
            print(decision.table(), flush=True)
            decided[name] = _answers(decision)
    return {"scenes": decided, "twelve_models": first}


def _answers(decision: Decision) -> dict[str, str]:
    tolerance = decision.answer.tolerance
    found = {}
    for label, factor in (("as stated", 1.0), ("a tenth", 0.1), ("ten times", 10.0)):
        chosen = decision.answer_for(tolerance.scaled(factor)).chosen
        found[label] = "none" if chosen is None else chosen.name
    return found


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    lines = [f"{'scene':<22}{'tolerance as stated':<28}{'a tenth of it':<28}ten times"]
    for name, found in result["scenes"].items():
        lines.append(
            f"{name:<22}{found['as stated']:<28}{found['a tenth']:<28}{found['ten times']}"
        )
    for go, took in zip(("first", "second"), result["twelve_models"], strict=True):
        lines.append(
            f"512 x 512, {len(TWELVE)} models x 3 shadings, {go} go: {took['seconds']:.1f} s "
            f"({took['cpu_seconds']:.1f} s of processor)"
        )
    return "\n".join(lines)


def main() -> None:
    """Print the machine, every answer, and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", nargs="*", choices=[*names(), []], help="which; all by default")
    parser.add_argument("--out", type=Path, default=Path("scenes"), help="folder for pictures")
    given = parser.parse_args()
    print("; ".join(f"{key} {value}" for key, value in machine().items()))
    print("\n" + table(run(given.name, given.out)))


if __name__ == "__main__":
    main()
