"""Plain text for people: the ranking, the parameters with their errors, what to beware of."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lobefit.fitting.identifiability_texts import limit_value
from lobefit.fitting.report import FitReport
from lobefit.fitting.result import FitResult, ParameterEstimate

__all__ = ["HELD", "aligned", "cautions", "flags", "parameters", "ranking", "with_error"]

MISSING = "-"
HELD = {"fixed": " (held)", "tied": " (tied)"}
"""What stands behind a value that the candidate does not fit, by its status."""


def ranking(report: FitReport) -> str:
    """Rank the candidates in a plain text table, the recommended one first.

    Parameters
    ----------
    report : FitReport
        All candidates.

    Returns
    -------
    str
        One line per candidate: rank, name, count of free parameters, BIC above the lowest,
        rmse in 1/sr, rms of log10(model/measured) or (where sigma is given) reduced
        chi-square, largest directional albedo of all
        channels, and `flags`. Then one line per candidate that could not be fitted.
    """
    known = [r.bic for r in report.results if r.bic is not None]
    lowest = min(known, default=0.0)
    rows = [
        (
            "",
            "candidate",
            "parameters",
            "BIC diff",
            "rmse [1/sr]",
            "red. chi2" if report.best.noise.given else "log10 rms",
            "max albedo",
            "flags",
        )
    ]
    for rank, r in enumerate(report.results, start=1):
        log10_rms = r.diagnostics.log10_rms
        rows.append(
            (
                str(rank),
                r.candidate,
                str(r.n_parameters),
                MISSING if r.bic is None else _difference(r.bic - lowest),
                f"{r.rmse:.3g}",
                f"{r.diagnostics.reduced_chi_square:.3g}"
                if r.noise.given
                else MISSING
                if log10_rms is None
                else f"{log10_rms:.3f}",
                f"{max(r.plausibility.albedo_max):.3f}",
                ", ".join(flags(r)),
            )
        )
    lines = aligned(rows, left=(1, 7))
    lines += [f"not fitted: {f.candidate}: {f.reason}" for f in report.failed]
    return "\n".join(lines)


def flags(result: FitResult) -> list[str]:
    """Give what to look at before trusting a result, a few words each."""
    said = []
    if result.diagnostics.misfit_limited:
        said.append("misfit-limited")
    if not result.plausibility.conserves_energy:
        said.append("albedo > 1")
    if not result.plausibility.reciprocal:
        said.append("not reciprocal")
    for status, words in (
        ("lower", "at lower bound"),
        ("upper", "at upper bound"),
        ("undetermined", "undetermined"),
    ):
        names = dict.fromkeys(e.name for e in result.estimates if e.status == status)
        said += [f"{name} {words}" for name in names]
    if not result.stop.converged:
        said.append("not converged")
    return said


def cautions(result: FitResult) -> list[str]:
    """Give the same as sentences with numbers, for the result that somebody will use."""
    said = []
    p = result.plausibility
    if not p.conserves_energy:
        k = max(range(len(p.albedo_max)), key=lambda c: p.albedo_max[c])
        said.append(
            f"albedo {p.albedo_max[k]:.3f} above 1 in {result.channels[k]} at theta_i "
            f"{math.degrees(p.albedo_max_theta_i[k]):.0f} deg: more light leaves than arrives"
        )
    if not p.reciprocal:
        said.append(
            f"the model is not reciprocal: f(i,o) and f(o,i) differ by up to "
            f"{100 * p.reciprocity_error:.2g} % of their sum"
        )
    known = result.identifiability
    apart = {(n, c.channel) for c in known.combinations for n in c.parameters} if known else set()
    for e in result.estimates:
        if known and known.limit(e.name, e.channel):
            continue  # a limit says more than a bound
        if e.status == "undetermined" and {(e.name, e.channel), (e.name, None)} & apart:
            continue
        if e.status in ("lower", "upper"):
            said.append(f"{_label(e, result)} = {e.value:.4g} lies on its {e.status} bound")
        elif e.status == "undetermined":
            said.append(f"{_label(e, result)} is not determined by these data")
    if len(said) > 12:  # 31 channels on one bound are one thing to know
        said = [s for s in said if " bound" not in s and "not determined" not in s]
        said += [f for f in flags(result) if f.endswith(("bound", "undetermined"))]
    if known:
        said += known.sentences
    if result.instrument is not None:
        said += result.instrument.sentences
    if not result.stop.converged:
        said.append(f"the search did not converge: {result.stop.reason}")
    return said


def parameters(result: FitResult) -> str:
    """Give the parameters with standard errors, channels below each other.

    Returns
    -------
    str
        Shared parameters a line each with their meaning, then a table with a row per
        channel and a column per parameter that channels have for themselves, then what
        was found of the instrument.
    """
    shared = [e for e in result.estimates if e.channel is None or len(result.channels) == 1]
    lines = aligned(
        [(e.name, _value(e, result), "" if e.unit == "1" else e.unit, e.meaning) for e in shared],
        left=(0, 1, 2, 3),
    )
    own = [e for e in result.estimates if e.channel is not None]
    if len(result.channels) > 1 and own:
        names = list(dict.fromkeys(e.name for e in own))
        cells = {(e.channel, e.name): _value(e, result) for e in own}
        rows = [("channel", *names)]
        rows += [(c, *(cells.get((c, n), MISSING) for n in names)) for c in result.channels]
        lines += aligned(rows, left=range(len(names) + 1))
    if result.instrument is not None and result.instrument.estimates:
        found = result.instrument.estimates
        lines += ["instrument"]
        lines += aligned(
            [(_label(e, result), _value(e, result), e.unit, e.meaning) for e in found],
            left=(0, 1, 2, 3),
        )
    return "\n".join(lines)


def with_error(value: float, error: float | None) -> str:
    """Write a value to the digits that its standard error leaves, two of the error's.

    Examples
    --------
    >>> with_error(0.21304, 0.00213)
    '0.2130 ± 0.0021'
    >>> with_error(1234.5, 67.8)
    '1234 ± 68'
    """
    if error is None or not math.isfinite(error) or error <= 0.0:
        return f"{value:.6g}"
    # Through the exponent form, which rounds 0.0996 to 1.0e-01 before counting digits.
    digits = 1 - int(f"{error:.1e}".partition("e")[2])
    if digits > 8 or error >= 1e5:
        return f"{value:.{max(digits - _places(value), 0)}e} ± {error:.1e}"
    rounding = max(digits, 0)
    return f"{value:.{rounding}f} ± {error:.{rounding}f}"


def _places(value: float) -> int:
    """Count the decimal places at which a number's exponent form begins."""
    return -int(f"{value:e}".partition("e")[2])


def _label(e: ParameterEstimate, result: FitResult) -> str:
    return e.label if len(result.channels) > 1 else e.name


def _value(e: ParameterEstimate, result: FitResult) -> str:
    limit = result.identifiability and result.identifiability.limit(e.name, e.channel)
    if limit:
        sign = "<" if limit.kind == "upper" else ">"
        return f"{e.value:.3g} ({sign} {limit_value(limit.value, e.value)})"
    if e.status == "undetermined" or _lost(e, result):
        return f"{e.value:.2g} (undetermined)"
    # On a bound the error is that of an estimate free to cross it, and no interval.
    bound = e.status in ("lower", "upper")
    text = with_error(e.value, None if bound else e.standard_error)
    return text + (f" ({e.status} bound)" if bound else HELD.get(e.status, ""))


def _lost(e: ParameterEstimate, result: FitResult) -> bool:
    """Tell whether a parameter cannot be told apart from others at all."""
    known = result.identifiability
    return known is not None and any(
        e.name in c.parameters and c.channel in (None, e.channel) and c.hopeless
        for c in known.combinations
    )


def _difference(bic: float) -> str:
    return f"{bic:.1f}" if bic < 1e4 else f"{bic:.2e}"


def aligned(rows: Sequence[tuple[str, ...]], left: Sequence[int]) -> list[str]:
    """Pad columns to their widest cell; those in `left` to the left, others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)] if rows else []
    return [
        "  ".join(
            cell.ljust(width) if k in left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
