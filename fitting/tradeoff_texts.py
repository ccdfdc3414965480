"""What a chart says: which choice was asked for, and one finding per panel."""

from __future__ import annotations

from lobefit.fitting.tradeoff_points import SAME, Panel, Point, front, within

__all__ = ["answer", "duration", "finding", "functions", "share"]

# A choice is not worth changing for less.
WORTH = 1.15
# Share of an error from which it is worth saying that it is noise.
MOSTLY = 0.5
# How much worse a cheaper choice may be, relatively, to be recommended.
WORSE = 1.1


def duration(seconds: float) -> str:
    """Write a time with three digits at most: ``40 ms``."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{_digits(seconds / size)} {unit}"
    return f"{_digits(seconds / 1e-9)} ns"


def share(error: float, percent: bool) -> str:
    """Write an error: percent where people read it so."""
    return f"{_digits(100.0 * error)} %" if percent else f"{error:.2g}"


def _digits(number: float) -> str:
    return f"{number:.0f}" if number >= 100.0 else f"{number:.3g}"


def answer(panel: Panel, tolerance: float, noise: float | None = None) -> str:
    """Say which fit keeps within the tolerance that was asked for, and what it takes.

    Parameters
    ----------
    panel : Panel
        The one of fits.
    tolerance : float
        Relative error.
    noise : float, optional
        Error that a perfect prediction would have.
    """
    asked = f"You asked for {100.0 * tolerance:g} %"
    chosen = within(panel.points, tolerance)
    if chosen is not None:
        return (
            f"{asked}: {chosen.label}, {duration(chosen.seconds.median)} "
            f"(error {share(chosen.error.median, True)})."
        )
    least = min(p.error.median for p in panel.points)
    level = [p for p in panel.points if p.error.median <= least * (1.0 + SAME)]
    best = min(level, key=lambda p: p.seconds.median)
    error, digits = 100.0 * best.error.median, 3
    while float(f"{error:.{digits}g}") <= 100.0 * tolerance and digits < 15:
        digits += 1  # 2.004 % is more than 2 %
    said = (
        f"{asked}: nothing comes so near; the nearest is {best.label} with "
        f"{error:.{digits}g} %, {duration(best.seconds.median)}."
    )
    if noise is None or noise < MOSTLY * best.error.median:
        return said
    return f"{said} The noise of the held-out readings alone is {share(noise, True)}."


def finding(panel: Panel, enough: float = 0.0) -> str:
    """Say in one sentence what the front means for who chooses.

    Parameters
    ----------
    panel : Panel
    enough : float
        An error that does no harm.

    Returns
    -------
    str
        How much faster another choice is than the usual one at about its error, or that none is.
    """
    usual = [p for p in panel.points if p.usual]
    members = [panel.points[k] for k in front(panel.points)]
    if not usual or not members:
        return ""
    base = min(usual, key=lambda p: (p.error.median, p.seconds.median))
    limit = max(WORSE * base.error.median, enough)
    near = [p for p in members if p.error.median <= limit and p is not base]
    quick = min(near, key=lambda p: p.seconds.median, default=None)
    level = [p for p in near if p.error.median <= (1.0 + SAME) * base.error.median]
    if quick is not None and level:  # what is as good may take a little longer
        as_good = min(level, key=lambda p: p.seconds.median)
        if as_good.seconds.median <= WORTH * quick.seconds.median:
            quick = as_good
    apart = quick is not None and quick.seconds.high < base.seconds.low
    if quick is not None and apart and base.seconds.median > WORTH * quick.seconds.median:
        return _faster(quick, base, panel.percent)
    below = [p for p in members if p.seconds.median * WORTH < base.seconds.median]
    if not below:
        return f"Nothing measured is faster than {base.label} ({duration(base.seconds.median)})."
    next_best = min(below, key=lambda p: p.error.median)
    return (
        f"Keep {base.label} ({duration(base.seconds.median)}, error "
        f"{share(base.error.median, panel.percent)}): the best of what is faster, "
        f"{next_best.label} ({duration(next_best.seconds.median)}), has an error of "
        f"{share(next_best.error.median, panel.percent)}."
    )


def functions(panel: Panel) -> str:
    """Say whether a cheaper exp and log buy anything."""
    said, gained = [], False
    for p in panel.points:
        if p.group != "functions" or p.settings["functions"] == "library":
            continue
        base = next(
            b
            for b in panel.points
            if b.group != "functions"
            and all(b.settings[k] == p.settings[k] for k in ("precision", "width"))
        )
        times = base.seconds.median / p.seconds.median
        gained |= times > WORTH and p.seconds.high < base.seconds.low
        name = f"{p.settings['functions']} in {p.settings['precision']}"
        said.append(f"{name} {times:.2g}, error {p.error.median:.0e}")
    if not said:
        return ""
    bought = "buys something" if gained else "buys nothing worth having"
    return f"A cheaper exp and log {bought} (speed against the usual: {'; '.join(said)})."


def _faster(quick: Point, base: Point, percent: bool) -> str:
    times = base.seconds.median / quick.seconds.median
    before, after = (share(p.error.median, percent) for p in (base, quick))
    if before == after or abs(quick.error.median / base.error.median - 1.0) <= SAME:
        worse = f"as good (error {after})"
    else:
        word = "worse" if quick.error.median > base.error.median else "better"
        worse = f"{word} (error {after} instead of {before})"
    return (
        f"{quick.label} is {times:.2g} times faster than {base.label} "
        f"({duration(quick.seconds.median)} instead of {duration(base.seconds.median)}) and {worse}."
    )
