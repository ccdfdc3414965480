"""What the commands say, as plain text and as JSON-ready values."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.report import FitReport
from lobefit.fitting.result import FitResult
from lobefit.fitting.tables import aligned, cautions, parameters
from lobefit.kernels import Model, Parameter, get_model
from lobefit.kernels.cost import Cost
from lobefit.kernels.library import SETS

__all__ = [
    "manual_page",
    "measurement_lines",
    "model_document",
    "model_list",
    "result_lines",
    "size",
    "wrapped",
]

WIDTH = 88


def wrapped(text: str, indent: str = "") -> str:
    """Break a paragraph into lines, those after the first indented."""
    return textwrap.fill(text, WIDTH, subsequent_indent=indent, break_on_hyphens=False)


def size(m: Measurement) -> str:
    """Say how much was measured."""
    names = ", ".join(m.channels if m.n_channels <= 6 else (*m.channels[:2], "...", m.channels[-1]))
    plural = "" if m.n_channels == 1 else "s"
    return f"{m.n_directions} directions, {m.n_channels} channel{plural} ({names})"


def measurement_lines(m: Measurement) -> Iterator[str]:
    """Say what was read, and what became of the rest."""
    material = m.metadata.get("material")
    yield wrapped(f"{m.source}: {size(m)}" + (f", {material}" if material else ""), "  ")
    if m.n_dropped or m.n_merged:
        yield f"  {m.rows_read} rows read, {m.n_dropped} dropped, {m.n_merged} merged into others"
    for entry in m.dropped:
        lines = ", ".join(map(str, entry.rows[:8])) + (", ..." if entry.count > 8 else "")
        where = f" (lines {lines})" if lines and entry.rows else ""
        yield wrapped(f"  dropped {entry.count}: {entry.rule}{where}", "    ")
    for note in m.notes:
        yield wrapped(f"  note: {note}", "    ")


def result_lines(report: FitReport) -> Iterator[str]:
    """Give the ranking, the best result's parameters and what to beware of."""
    best = report.best
    model = get_model(best.model)
    yield report.table()
    yield f"\n{best.candidate}: {model.title}"
    yield wrapped(f"  {model.convention}", "  ")
    if best.options:
        yield "  " + ", ".join(f"{option} {choice}" for option, choice in best.options.items())
    for line in parameters(best).splitlines():
        yield f"  {line}"
    yield wrapped(f"  {noise_line(best)}", "  ")
    warnings = cautions(best)
    if warnings:
        yield "\nBeware"
        for text in warnings:
            yield wrapped(f"  - {text}", "    ")
    if report.checks.suspicious:
        yield "\nThe data"
        for found in report.checks.suspicious:
            yield wrapped(f"  - {found.sentence}", "    ")
            if found.remedy:
                yield wrapped(f"    {found.remedy}", "    ")
    if best.diagnostics.worst:
        yield "\nWorst fitted"
        for text in best.diagnostics.worst:
            yield wrapped(f"  - {text}", "    ")
    yield "\n" + wrapped(f"metric {report.metric}, {report.seconds:.2g} s on {best.stop.device}")


def noise_line(result: FitResult) -> str:
    """Say which noise the residuals were weighed with."""
    noise = result.noise
    tails = "" if noise.nu is None else f"; Student's t with {noise.nu:g} degrees of freedom"
    if noise.given:
        reduced = result.diagnostics.reduced_chi_square
        return f"noise: the given sigma; reduced chi-square {reduced:.3g}{tails}"
    if result.bic is None:
        return "noise: not estimated with this metric"
    scales = [
        f"{100 * r:.2g} % of the value and {a:.2g} 1/sr" if r else f"{a:.2g} 1/sr"
        for r, a in zip(noise.relative, noise.additive, strict=True)
    ]
    if len(scales) == 1:
        return f"noise found: {scales[0]}{tails}"
    shown = [f"{c} {s}" for c, s in zip(result.channels, scales, strict=True)]
    rest = f"; {len(shown) - 3} more in the report" if len(shown) > 3 else ""
    return f"noise found: {'; '.join(shown[:3])}{rest}{tails}"


def model_list(models: Iterable[Model], costs: Sequence[Cost] = ()) -> str:
    """Give a line for each model, with its cost where that was measured."""
    rows = [("model", "sets", "")]
    for m in models:
        found = {*m.sets, *(s for v in m.variants for s in v.sets or ())}
        sets = ", ".join(s for s in SETS if s in found) or "by name"
        rows.append((m.name, sets, m.title))
    if not costs:
        return "\n".join(aligned(rows, left=range(3)))
    measured = ["ns", *(f"{c.ns:.2f}" for c in costs)]
    table = [(row[0], ns, *row[1:]) for row, ns in zip(rows, measured, strict=True)]
    return "\n".join([*aligned(table, left=(0, 2, 3)), "", cost_line(costs[0].device)])


def cost_line(device: str) -> str:
    """Say what the nanoseconds are."""
    return wrapped(
        f"ns: per direction and set of parameters, within the sum of squared residuals in "
        f"single precision, on {device}"
    )


def _parameter_rows(parameters: Iterable[Parameter]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for p in parameters:
        low, high = p.bounds
        kind = "per channel" if p.per_channel else "shared"
        if p.linear:
            kind += ", linear"
        rows.append((p.name, p.unit, f"{low:g} to {high:g}", f"{p.default:g}", kind, p.meaning))
    return rows


def _option_lines(model: Model) -> Iterator[str]:
    """Give the choices of each option, and the parameters that choices bring."""
    for option, choices in model.allowed.items():
        yield f"{option}: {', '.join(choices)}"
        default = {p.name for p in model.parameters}
        for choice in choices[1:]:
            chosen = model.choose({option: choice})
            brought = [p for p in chosen.parameters if p not in model.parameters]
            left = sorted(default - {p.name for p in chosen.parameters})
            if brought or left:
                without = f", without {', '.join(left)}" if left else ""
                yield f"  {choice}{without}{':' if brought else ''}"
                for line in aligned(_parameter_rows(brought), left=range(6)):
                    yield f"    {line}"


def manual_page(model: Model, cost: Cost | None = None) -> str:
    """Give the manual page with the tables of parameters and properties."""
    rows: list[tuple[str, ...]] = [
        ("name", "unit", "range", "default", "", "meaning"),
        *_parameter_rows(model.parameters),
    ]
    lines = [model.page, "", "Parameters", "----------", *aligned(rows, left=range(6))]
    flags = {"reciprocal": model.reciprocal, "isotropic": model.isotropic}
    said = [word if holds else f"not {word}" for word, holds in flags.items()]
    lines += ["", "Properties", "----------", f"{', '.join(said)}; {model.energy}"]
    lines.append(f"candidate sets: {', '.join(model.sets) or 'none; fitted where it is named'}")
    variants = ", ".join(f"{model.name}:{v.name}" for v in model.variants)
    if variants:
        lines.append(f"variants: {variants}")
    partners = ", ".join(f"{model.name}+{partner}" for partner in model.lobe.partners)
    if partners:
        lines.append(f"sums: {partners}; any other two lobes by name, as {model.name}+phong")
    if model.allowed:
        lines += ["", "Options", "-------", *_option_lines(model)]
    if cost:
        ends = f"{cost.fastest:.2f} to {cost.slowest:.2f}"
        lines += ["", "Cost", "----", f"{cost.ns:.2f} ns ({ends})", cost_line(cost.device)]
    return "\n".join(lines)


def _parameter(p: Parameter) -> dict[str, Any]:
    return {
        "name": p.name,
        "unit": p.unit,
        "meaning": p.meaning,
        "lower": p.bounds[0],
        "upper": None if p.bounds[1] == float("inf") else p.bounds[1],
        "default": p.default,
        "per_channel": p.per_channel,
        "linear": p.linear,
    }


def model_document(model: Model, cost: Cost | None = None) -> dict[str, Any]:
    """Give the same as JSON-ready values."""
    return {
        "name": model.name,
        "title": model.title,
        "convention": model.convention,
        "source": model.source,
        "energy": model.energy,
        "reciprocal": model.reciprocal,
        "isotropic": model.isotropic,
        "sets": list(model.sets),
        "variants": [f"{model.name}:{v.name}" for v in model.variants],
        "options": {
            option: {
                choice: [_parameter(p) for p in model.choose({option: choice}).parameters]
                for choice in choices
            }
            for option, choices in model.allowed.items()
        },
        "parameters": [_parameter(p) for p in model.parameters],
        "page": model.page,
    } | ({"cost": {"unit": "ns per direction", **asdict(cost)}} if cost else {})
