"""The peak's place: a tilted sample or a wrong zero of an angle moves it off the mirror direction."""

from __future__ import annotations

from functools import partial

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import Scan, View, plural

__all__ = ["check_peak"]

# Wider peaks move by themselves: Fresnel and masking terms change across them.
WIDEST = np.radians(30.0)
OBLIQUE, GRAZING = np.radians(4.0), np.radians(62.0)
NEAR = np.radians(15.0)
# Natural shift of a peak of width w at theta: this times w^2 tan(theta), in radians.
NATURAL = 0.3
LEAST_DEG = 0.25
# Steps in a peak's width from which on its place is known better than half a step.
STEPS = 2.0
# How far a peak stands above its scan; and one of fewer than three readings above what is near,
# since one bad reading on a broad peak looks like a narrow one.
CONTRAST, SHARP = 3.0, 10.0


def check_peak(view: View) -> DataCheck:
    """Locate the peak of each in-plane scan at half its height."""
    shifts, resolutions, widths, natural = [], [], [], []
    for scan in view.scans:
        found = _peak(view, scan)
        if found is not None:
            shift, width, step = found
            shifts.append(shift)
            widths.append(width)
            resolutions.append(step)
            natural.append(NATURAL * width**2 * np.tan(scan.fixed))
    answer = partial(DataCheck, name="peak position")
    if not shifts:
        return answer(
            verdict="cannot tell",
            figures={"scans": 0},
            sentence="No in-plane scan crosses a peak narrower than "
            f"{np.degrees(WIDEST):.0f}° near the mirror direction.",
        )
    degrees = np.degrees(np.array(shifts))
    shift = float(np.median(degrees))
    spread = 1.4826 * float(np.median(np.abs(degrees - shift))) / np.sqrt(len(degrees))
    resolution = float(np.degrees(np.median(resolutions)))
    width = float(np.degrees(np.median(widths)))
    # Across many steps the flanks are interpolated well within one.
    coarse = max(LEAST_DEG, 0.5 * resolution * min(1.0, STEPS * resolution / width))
    surface = float(np.degrees(np.median(natural)))
    noticed = abs(shift) > max(coarse, 3.0 * spread)
    figures = {
        "scans": len(shifts),
        "shift_deg": shift,
        "shift_spread_deg": spread,
        "largest_shift_deg": float(degrees[np.argmax(np.abs(degrees))]),
        "width_deg": width,
        "step_deg": resolution,
        "natural_deg": surface,
    }
    lie = "lies" if len(shifts) == 1 else "lie"
    what = f"{plural(len(shifts), 'peak')}, {figures['width_deg']:.2g}° wide, {lie}"
    if len(shifts) > 1 and noticed and abs(shift) > surface:
        way = "away from" if shift > 0.0 else "towards"
        return answer(
            verdict="suspicious",
            figures=figures,
            sentence=f"{what} {abs(shift):.2f}° off the mirror direction, {way} the normal "
            f"(median; step {resolution:.2g}°).",
            remedy=f"a sample tilted by {abs(shift) / 2.0:.2f}°, or a zero of an angle off by "
            f"{abs(shift):.2f}°: align, or correct the angles",
        )
    if noticed:
        return answer(
            verdict="cannot tell",
            figures=figures,
            sentence=f"{what} {shift:+.2f}° from the mirror direction (median): "
            + (
                f"surfaces with lobes of that width can do so by up to {surface:.1f}° themselves."
                if abs(shift) <= surface
                else "one scan is not enough to tell a tilt."
            ),
            remedy="compare a narrower peak, or the same scan with the sample turned by 180°",
        )
    return answer(
        verdict="ok",
        figures=figures,
        sentence=f"{what} {shift:+.2f}° from the mirror direction (median; step "
        f"{resolution:.2g}°).",
    )


def _peak(view: View, scan: Scan) -> tuple[float, float, float] | None:
    """Give the peak's distance from the mirror direction, its width and the step, in radians."""
    if not OBLIQUE <= scan.fixed <= GRAZING:
        return None
    # Without the cosines that every microfacet lobe is divided by, the peak is symmetric.
    y = view.level[scan.rows] * np.cos(scan.running)
    good = np.isfinite(y)
    x, y = scan.running[good], y[good]
    near = np.flatnonzero(np.abs(x - scan.fixed) < NEAR)
    if near.size < 5 or not x[0] < scan.fixed < x[-1]:
        return None
    top = near[np.argmax(y[near])]
    if y[top] < CONTRAST * np.median(y):
        return None
    half = np.log(0.5 * y[top])
    logs = np.log(y)
    left, right = top, top
    while left >= 0 and logs[left] > half:
        left -= 1
    while right < len(y) and logs[right] > half:
        right += 1
    if left < 0 or right == len(y):
        return None
    if right - left - 1 < 3 and y[top] < SHARP * np.median(y[near]):
        return None
    low = np.interp(half, logs[[left, left + 1]], x[[left, left + 1]])
    high = np.interp(-half, -logs[[right - 1, right]], x[[right - 1, right]])
    step = float(np.max(np.diff(x[left : right + 1])))
    width = float(high - low)
    if not 0.0 < width < WIDEST:
        return None
    return float(0.5 * (low + high) - scan.fixed), width, step
