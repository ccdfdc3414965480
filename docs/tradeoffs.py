"""Make the charts of speed against accuracy again: docs/tradeoffs.md and docs/images/chart_*.png.

Run as ``python -m docs.tradeoffs`` or ``make chart``. Everything on the page is measured then.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from docs.make import FOLDER as MODELS
from lobefit.fitting import read_measurement
from lobefit.fitting.tradeoff import GROUPS, Chart, chart
from lobefit.fitting.tradeoff_points import front
from lobefit.fitting.tradeoff_subject import held_out
from lobefit.fitting.tradeoff_texts import duration, share

__all__ = ["SAMPLES", "make", "page"]

DOCS = MODELS.parent
SAMPLES = {
    "rough_copper": GROUPS,
    "glossy_plastic": ("fit",),
    "matte_paint": ("fit",),
}
"""Samples, and which panels each has."""
REPEATS = 3


def page(charts: dict[str, Chart]) -> str:
    """Write the page; returns Markdown."""
    return "\n".join([*_head(next(iter(charts.values()))), *_bodies(charts), ""])


def _head(first: Chart) -> Iterator[str]:
    versions = ", ".join(f"{name} {number}" for name, number in first.versions.items())
    yield "# Speed against accuracy"
    yield ""
    yield (
        "`lobefit chart FILE --out DIR` fits one part of a measurement in many ways and scores each "
        "on the part that was kept back: models, options, metrics, less data, other searches. "
        "`lobefit chart ggx:k_s=1 --param alpha=0.3 --param F0=0.9` does so for a simulated "
        "surface, scored against the truth. Below the front is what would be both faster and "
        "better; nothing measured is."
    )
    yield ""
    yield (
        f"Made by `make chart` on {first.device}, {versions}, with the median of {REPEATS} runs "
        "turn by turn; bars and ranges are quartiles. Errors within 1 % of each other count as "
        "the same. Errors are root mean squares of relative errors of the held-out readings, "
        "whose own noise is in them."
    )


def _bodies(charts: dict[str, Chart]) -> Iterator[str]:
    for name, made in charts.items():
        yield from ("", f"## {name}", "", f"**{made.answer}** {made.finding}", "")
        yield f"![Time against error for {name}](images/chart_{name}.png)"
        for panel in made.panels:
            yield from ("", f"### {panel.title}", "")
            if panel.name != "fit":
                yield from (panel.finding, "")
            yield from ("| on the front | time | quartiles | error |", "|---|---|---|---|")
            for k in front(panel.points):
                p = panel.points[k]
                spread = f"{duration(p.seconds.low)} to {duration(p.seconds.high)}"
                error = share(p.error.median, panel.percent)
                yield f"| {p.label} | {duration(p.seconds.median)} | {spread} | {error} |"
            yield ""
            yield f"{len(panel.points)} choices. {_sentences(panel.notes)}"


def _sentences(notes: tuple[str, ...]) -> str:
    return " ".join(f"{note[:1].upper()}{note[1:]}." for note in notes)


def make() -> None:
    """Measure, draw and write."""
    checkout = DOCS.parent
    charts: dict[str, Chart] = {}
    for name, groups in SAMPLES.items():
        subject = held_out(read_measurement(checkout / "samples" / f"{name}.csv"))
        charts[name] = chart(subject, groups=groups, repeats=REPEATS)
        print(f"{name}: {charts[name].answer} {charts[name].finding}", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            written = charts[name].save(Path(folder) / "chart")
            shutil.copy(written["chart"], DOCS / "images" / f"chart_{name}.png")
            shutil.copy(written["json"], DOCS / "images" / f"chart_{name}.json")
    (DOCS / "tradeoffs.md").write_text(page(charts), encoding="utf-8")


if __name__ == "__main__":
    make()
