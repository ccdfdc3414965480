"""How far two pictures are apart, as seen: sRGB, D65, CIE ΔE2000; or relative radiance.

R, G and B of the data are taken as linear sRGB (IEC 61966-2-1, white D65). Radiance is multiplied
by the exposure, clipped to 0 to 1, turned to CIELAB (D65, 2 degrees) and compared by CIE ΔE2000
(G. Sharma, W. Wu, E. N. Dalal, The CIEDE2000 color-difference formula, Color Research and
Application 30(1), 2005).

The colour science is scikit-image's: measured beside colour-science 0.4.7 it takes 58 MB with what
it needs beyond scipy (that one 88 MB), a seventh of the time to import and half the time for the
differences of 200,000 pixels. ColorAide (2 MB) has no arrays and would take minutes; the small
vectorised packages differ by 0.006 in ΔE for their rounded matrices.

Relative radiance, for data that are no RGB: a pixel's error is the largest over the channels of
``|L - L_ref| / max(L_ref, 0.05 m)``, m the channel's mean over the object.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.scene_file import Exposure
from lobefit.kernels.errors import SceneError

__all__ = ["MEASURES", "Errors", "Yardstick", "encoded", "exposure_factor", "need_colour_science"]

Array = NDArray[np.float64]
Image = NDArray[np.floating[Any]]

MEASURES = {"delta_e": "ΔE2000", "relative": "relative error"}
DARK = 0.05
AT_ONCE = 20_000  # pixels: what stays in a processor's cache
THREADS = 4


@dataclass(frozen=True)
class Errors:
    """How far a picture is from the reference.

    Attributes
    ----------
    mean, p99 : float
        Mean and 99th percentile over the pixels that show the object in either picture.
    largest : float
    clipped : float
        Share of those pixels that clipping changes in the picture; 0 for relative radiance.
    """

    mean: float
    p99: float
    largest: float
    clipped: float


def need_colour_science() -> Any:
    """Import scikit-image's colour module.

    Raises
    ------
    SceneError
        It is not installed; the message says what to install.
    """
    try:
        from skimage import color
    except ImportError as error:
        raise SceneError(
            f"colour differences need scikit-image ({error}); install it with "
            "`pip install 'lobefit[scene]'`, or state a tolerance of relative radiance"
        ) from error
    return color


def exposure_factor(wanted: Exposure, radiance: Image, shown: NDArray[np.bool_]) -> float:
    """Give what radiance is multiplied by; 1 for a black picture.

    Parameters
    ----------
    wanted : Exposure
        As the scene states it.
    radiance : ndarray, shape (C, H, W)
        The reference.
    shown : ndarray of bool, shape (H, W)
        Pixels that show the object.
    """
    if wanted.factor is not None:
        return wanted.factor
    brightest = radiance.max(axis=0)[shown]
    bright = float(np.percentile(brightest, wanted.percentile)) if brightest.size else 0.0
    return wanted.level / bright if bright > 0.0 else 1.0


def encoded(radiance: Image, factor: float) -> Array:
    """Give what a screen gets of radiance (3, H, W): sRGB from 0 to 1, shape (H, W, 3)."""
    color = need_colour_science()
    return np.asarray(color.xyz2rgb(_xyz(color, np.moveaxis(radiance, 0, -1), factor)))


def _xyz(color: Any, radiance: Image, factor: float) -> Array:
    """Expose, clip and turn linear sRGB (..., 3) into CIE XYZ."""
    linear = np.clip(np.asarray(radiance, dtype=np.float64) * factor, 0.0, 1.0)
    return np.asarray(linear @ color.colorconv.xyz_from_rgb.T)


class Yardstick:
    """A reference that pictures are compared with.

    Parameters
    ----------
    measure : {"delta_e", "relative"}
        See `lobefit.fitting.scene_file.Tolerance`.
    reference : ndarray, shape (C, H, W)
        Radiance.
    mask : ndarray of bool, shape (H, W)
        Pixels of it that show the object.
    factor : float
        The exposure.

    Raises
    ------
    SceneError
        scikit-image is needed and not there; ΔE of other than three channels.
    """

    def __init__(
        self,
        measure: Literal["delta_e", "relative"],
        reference: Image,
        mask: NDArray[np.bool_],
        factor: float,
    ) -> None:
        self.measure, self.factor, self.mask = measure, factor, mask
        self.reference = np.asarray(reference, dtype=np.float64)
        if measure == "delta_e":
            self._color = need_colour_science()
            if len(reference) != 3:
                raise SceneError("ΔE2000 needs R, G and B; state a tolerance of relative radiance")
            self._lab = self._to_lab(self.reference.reshape(3, -1).T)
        else:
            inside = self.reference[:, mask]
            mean = inside.mean(axis=1) if inside.size else np.ones(len(inside))
            self._floor = np.maximum(DARK * mean, 1e-300)[:, None, None]

    def _to_lab(self, radiance: Array) -> Array:
        return np.asarray(self._color.xyz2lab(_xyz(self._color, radiance, self.factor)))

    def differences(self, picture: Image) -> Array:
        """Give the error of each pixel, shape (H, W); 0 where both pictures are empty."""
        shape = self.mask.shape
        if self.measure == "relative":
            size = np.maximum(self.reference, self._floor)
            return np.asarray((np.abs(picture - self.reference) / size).max(axis=0))
        rows = np.asarray(picture, dtype=np.float64).reshape(3, -1).T
        found = np.zeros(len(rows))
        # Pixels that are black in both, as outside the object, need no formula.
        some = np.flatnonzero(rows.any(axis=1) | self._lab.any(axis=1))

        def fill(part: NDArray[np.intp]) -> None:
            lab = self._to_lab(rows[part])
            found[part] = self._color.deltaE_ciede2000(self._lab[part], lab)

        parts = np.array_split(some, max(1, -(-some.size // AT_ONCE)))
        with ThreadPoolExecutor(THREADS) as pool:
            list(pool.map(fill, parts))
        return found.reshape(shape)

    def errors(self, picture: Image, mask: NDArray[np.bool_]) -> Errors:
        """Summarise the errors of a picture, shape (C, H, W), that shows the object at `mask`."""
        shown = mask | self.mask
        values = self.differences(picture)[shown]
        if not values.size:
            raise SceneError("the view does not show the object; move the eye or the object")
        clipped = 0.0
        if self.measure == "delta_e":
            clipped = float((picture.max(axis=0)[shown] * self.factor > 1.0).mean())
        return Errors(
            float(values.mean()), float(np.percentile(values, 99)), float(values.max()), clipped
        )
