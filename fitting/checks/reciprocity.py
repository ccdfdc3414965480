"""Reciprocity: the same value with light and detector exchanged; a cosine too many breaks it."""

from __future__ import annotations

from functools import partial

import numpy as np

from lobefit.fitting.checks.finding import DataCheck, Figure, Verdict
from lobefit.fitting.checks.pairs import MAX_THETA, Pairs, reciprocal_pairs
from lobefit.fitting.checks.surface import Fitted
from lobefit.fitting.checks.view import View, plural
from lobefit.kernels import evaluate

__all__ = ["check_cosine_factor", "check_reciprocity", "exchange"]

# Half a cosine: nearer to one too many than to none.
HALF = 0.5
# Below this exponent the difference is alignment and noise.
SMALL = 0.25
# An exponent known worse than this says nothing about a cosine.
UNSURE = 0.2
# ln of a ratio that counts as not reciprocal without being a cosine.
LARGE = 0.3
# Pairs that stand out alike: so many, of all so large a share, with this share of one sign.
STANDING, PART, ALIKE = 3, 0.05, 0.9
# ln of their median ratio, beyond what alignment can do.
CLEAR = 0.15
# Residuals of a model in ln f that still leave a cosine visible.
FITTED = 0.3


def exchange(view: View, result: Fitted | None) -> Pairs | None:
    """Find reciprocal pairs, else compare with the symmetric part of the fitted model.

    The model's values with light and detector exchanged are averaged (geometrically); what
    is left of the measured values has twice the exponent of its pairs.
    """
    pairs = reciprocal_pairs(view)
    m = view.m
    if pairs is not None or result is None or len(view.incidences) < 3:
        return pairs
    rows = np.flatnonzero(np.isfinite(view.level) & (np.maximum(m.theta_i, m.theta_o) < MAX_THETA))
    if rows.size < 20:
        return None
    i, o = (m.theta_i[rows], m.phi_i[rows]), (m.theta_o[rows], m.phi_o[rows])
    there, back = (
        evaluate(result.model, result.params, *angles, options=result.options).mean(axis=0)
        for angles in ((*i, *o), (*o, *i))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.log(view.level[rows]) - 0.5 * np.log(there * back)
    cosines = view.log_cosines(rows)
    good = np.isfinite(rest) & (np.abs(cosines) > 0.1)
    # Both views further from the normal than the light and nearer, or the part that is not
    # reciprocal is not told from the model's misfit.
    if good.sum() < 20 or not 0.2 < np.mean(cosines[good] > 0.0) < 0.8:
        return None
    rest = rest[good] - np.median(rest[good])
    found = Pairs(2.0 * rest, cosines[good], "model")
    left = np.median(np.abs(rest - 0.5 * found.exponent * cosines[good]))
    return found if left < FITTED else None


def check_reciprocity(pairs: Pairs | None) -> DataCheck:
    """Compare values with light and detector exchanged."""
    answer = partial(DataCheck, name="reciprocity")
    if pairs is None:
        return answer(
            verdict="cannot tell",
            figures={"pairs": 0},
            sentence="No two directions are, or are nearly, each other with light and detector "
            "exchanged.",
            remedy="measure some pairs: each incidence angle as a view of the other incidences",
        )
    p, error = pairs.exponent, pairs.exponent_error
    drift = float(np.median(-pairs.ratio * np.sign(pairs.cosines)))
    figures: dict[str, Figure] = {
        "pairs": len(pairs),
        "kind": pairs.kind,
        "median_ratio": pairs.median_ratio,
        "grazing_ratio": float(np.exp(drift)),
        **_exponent(pairs),
    }
    outward = pairs.outward
    alike = max(np.mean(outward > 0.0), np.mean(outward < 0.0)) if outward.size else 0.0
    standing = float(np.median(np.abs(outward))) if outward.size else 0.0
    figures |= {"standing_out": outward.size, "standing_out_ratio": float(np.exp(standing))}
    noun = "value" if pairs.kind == "model" else "reciprocal pair"
    ratio = f"{plural(len(pairs), noun)} ({_how(pairs)})"
    by = f"a factor {pairs.median_ratio:.2f} (median)"
    verdict: Verdict = "ok"
    remedy = ""
    if pairs.kind == "model":
        by = f"cos(theta_o)^({p:.2f})"
    sentence = f"{ratio} agree within {by}."
    if _cosine(pairs):
        verdict = "suspicious"
        size = "the size of one cosine" if abs(abs(p) - 1.0) < HALF / 2.0 else "no single cosine"
        sentence = f"{ratio} differ by {by}: cos(theta_o)^({p:.2f}), {size}."
        remedy = _which(p)
    elif pairs.kind != "model" and abs(drift) > LARGE and abs(p) > 3.0 * error:
        verdict = "suspicious"
        sentence = f"{ratio} differ by {by}, which no cosine explains (exponent {p:.2f})."
        remedy = "check alignment and footprint: the larger polar angle must not change the value"
    elif error > UNSURE:
        verdict = "cannot tell"
        sentence = (
            f"{ratio} are too few or too noisy: their cos(theta_o)^({p:.2f} ± {error:.2f}) tells "
            "no cosine from none."
        )
        remedy = "measure more pairs, or each of them longer"
    elif abs(p) > SMALL or (pairs.kind == "model" and abs(p) > SMALL / 2.0):
        verdict = "cannot tell"
        sentence = (
            f"{ratio} differ by {by}: cos(theta_o)^({p:.2f} ± {max(error, 0.01):.2f}), "
            "less than a cosine and more than nothing."
        )
        remedy = "alignment, aperture or noise; measure more pairs below 75 degrees"
    elif outward.size >= max(STANDING, PART * len(pairs)) and alike >= ALIKE and standing > CLEAR:
        # Where the median is of a diffuse floor, a lobe shows in few pairs only.
        verdict = "suspicious"
        more = "smaller" if np.median(outward) < 0.0 else "larger"
        sentence = (
            f"{outward.size} of {ratio} stand out from noise and alignment: there the value at the "
            f"larger view angle is {more} by a factor {figures['standing_out_ratio']:.2f} (median)."
        )
        remedy = (
            "a lobe that is not reciprocal over a part that is: a cosine in the lobe alone (Phong), "
            "or a footprint that overfills the sample at grazing angles"
        )
    return answer(verdict=verdict, figures=figures, sentence=sentence, remedy=remedy)


def check_cosine_factor(pairs: Pairs | None) -> DataCheck:
    """Tell whether the values carry a cosine that a BRDF has not."""
    answer = partial(
        DataCheck, name="cosine factor", figures={} if pairs is None else _exponent(pairs)
    )
    if pairs is None or (pairs.exponent_error > UNSURE and not _cosine(pairs)):
        return answer(
            verdict="cannot tell",
            sentence="Without enough reciprocal pairs a cosine is not told from the surface's "
            "own fall-off.",
            remedy="make sure from the instrument's description that the values are f, "
            "not f cos(theta_o)",
        )
    p, error = pairs.exponent, pairs.exponent_error
    if _cosine(pairs):
        return answer(
            verdict="suspicious",
            sentence=f"The values follow cos(theta_o)^({p:.2f}) beyond what a reciprocal surface can.",
            remedy=_which(p),
        )
    if abs(p) > SMALL:
        return answer(
            verdict="cannot tell",
            sentence=f"An exponent of {p:.2f} ± {max(error, 0.01):.2f} is neither a cosine nor none.",
            remedy="measure more pairs below 75 degrees",
        )
    return answer(
        verdict="ok",
        sentence=f"No cosine too many or too few: cos(theta_o)^({p:.2f} ± {max(error, 0.01):.2f}).",
    )


def _exponent(pairs: Pairs) -> dict[str, Figure]:
    return {"cosine_exponent": pairs.exponent, "cosine_exponent_error": pairs.exponent_error}


def _cosine(pairs: Pairs) -> bool:
    return abs(pairs.exponent) > max(HALF, 3.0 * pairs.exponent_error)


def _how(pairs: Pairs) -> str:
    return {
        "exact": "measured",
        "interpolated": "one side interpolated",
        "model": "beside the fitted model's symmetric part",
    }[pairs.kind]


def _which(p: float) -> str:
    if abs(abs(p) - 1.0) >= HALF / 2.0:
        return "check how the values were divided by cosines"
    if p > 0.0:
        return (
            "the values are f cos(theta_o), or f over cos(theta_i): declare "
            "`# quantity: cosine-weighted brdf`, or multiply by cos(theta_i)"
        )
    return (
        "the values are f cos(theta_i), or f over cos(theta_o): the division by a cosine was "
        "made once too often or with the wrong angle"
    )
