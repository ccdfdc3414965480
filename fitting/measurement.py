"""What a goniometer measured: directions, channels, values and their provenance.

Angles are radians here (files are in degrees), values are BRDF in 1/sr. The arrays of a
`Measurement` are read-only, so that whatever is computed from them can be kept.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.fitting.azimuth import count_axes
from lobefit.kernels.errors import MeasurementError

__all__ = ["DIRECTION_COLUMNS", "Dropped", "Measurement"]

DIRECTION_COLUMNS = ("theta_i", "phi_i", "theta_o", "phi_o")

# Names that a file cannot carry unambiguously, or that mean something else in its header.
_BAD_NAME = re.compile(r"^#|^sigma_|[,;\"\x00-\x1f\x7f]|^\s|\s$|^$")

# A turned sample shows at least this; degrees because they are what people turn by.
_AXIS_TOLERANCE = np.deg2rad(1.0)
_POLE_REGION = np.deg2rad(1.0)
_OBLIQUE = np.deg2rad(10.0)


@dataclass(frozen=True, slots=True)
class Dropped:
    """One rule that removed rows.

    Parameters
    ----------
    rule : str
        Why, e.g. ``"at or below the horizon"``.
    rows : tuple of int
        Line numbers in the file, at most the first 20.
    count : int
        How many rows in all.
    """

    rule: str
    rows: tuple[int, ...]
    count: int


@dataclass(frozen=True, eq=False, repr=False)
class Measurement:
    """A measured BRDF.

    Parameters
    ----------
    theta_i, phi_i, theta_o, phi_o : array, shape [N]
        Directions in radians; both point away from the surface, theta from its normal.
        The mirror direction is ``theta_o = theta_i``, ``phi_o = phi_i + pi``.
    values : array, shape [C, N]
        BRDF in 1/sr; NaN where a channel has no reading. Negative values are allowed.
    channels : sequence of str
        C names.
    sigma : array, shape [C, N], optional
        Standard uncertainty in 1/sr, positive wherever the value is present.
    metadata : dict of str to str
        What the file says about itself, apart from units, which are fixed here.
    dropped : tuple of Dropped
        Which rows of the file are not here, by rule.
    notes : tuple of str
        What else was done to the file's numbers.
    source : str
        Name of the file, without its folder.
    rows_read : int
        Data rows in the file; N if the measurement comes from no file.

    Raises
    ------
    MeasurementError
        If shapes disagree, an angle is not finite or outside the upper hemisphere,
        a value is infinite, or sigma is not positive where there is a value.
    """

    theta_i: NDArray[np.float64]
    phi_i: NDArray[np.float64]
    theta_o: NDArray[np.float64]
    phi_o: NDArray[np.float64]
    values: NDArray[np.float64]
    channels: tuple[str, ...]
    sigma: NDArray[np.float64] | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    dropped: tuple[Dropped, ...] = ()
    notes: tuple[str, ...] = ()
    source: str = ""
    rows_read: int = 0

    def __post_init__(self) -> None:
        """Make the arrays float64 and read-only; refuse what no fit could use."""
        store = object.__setattr__
        store(self, "channels", tuple(self.channels))
        store(self, "metadata", dict(self.metadata))
        self._check_channels()
        for name in DIRECTION_COLUMNS:
            store(self, name, _frozen(getattr(self, name)))
        if self.theta_i.ndim != 1 or self.theta_i.size == 0:
            raise self._error(f"needs directions, got an array of shape {self.theta_i.shape}")
        for name in DIRECTION_COLUMNS:
            self._check_angle(name)
        shape = (len(self.channels), self.theta_i.size)
        store(self, "values", _frozen(self.values))
        if self.values.shape != shape:
            raise self._error(f"values have shape {self.values.shape}", expected=str(shape))
        if np.isinf(self.values).any():
            raise self._error("values contain infinity", expected="finite numbers, NaN if missing")
        if self.sigma is not None:
            store(self, "sigma", _frozen(self.sigma))
            if self.sigma.shape != shape:
                raise self._error(f"sigma has shape {self.sigma.shape}", expected=str(shape))
            usable = np.isnan(self.values) | ((self.sigma > 0) & (self.sigma < np.inf))
            if not usable.all():
                raise self._error("sigma is not positive and finite at every value")
        if not self.rows_read:
            store(self, "rows_read", self.n_directions)

    def __repr__(self) -> str:
        """Give size and channels, not the arrays."""
        names = ", ".join(self.channels[:6]) + (", ..." if self.n_channels > 6 else "")
        return f"<Measurement {self.source or 'unnamed'}: {self.n_directions} directions, {names}>"

    def _error(self, message: str, *, expected: str | None = None) -> MeasurementError:
        return MeasurementError(message, file=self.source or None, expected=expected)

    def _check_channels(self) -> None:
        if not self.channels:
            raise self._error("a measurement needs at least one channel")
        if len(set(self.channels)) != len(self.channels):
            raise self._error(f"channel names repeat: {', '.join(self.channels)}")
        for name in self.channels:
            if _BAD_NAME.search(name) or name in DIRECTION_COLUMNS:
                raise self._error(f"{name!r} cannot name a channel")

    def _check_angle(self, name: str) -> None:
        angle: NDArray[np.float64] = getattr(self, name)
        if angle.shape != self.theta_i.shape:
            raise self._error(f"{name} has shape {angle.shape}", expected=f"{self.theta_i.shape}")
        if not np.isfinite(angle).all():
            raise self._error(f"{name} contains a number that is not finite")
        if name.startswith("theta") and (angle.min() < 0 or angle.max() >= np.pi / 2):
            raise self._error(
                f"{name} runs from {angle.min():.6g} to {angle.max():.6g} rad",
                expected="polar angles from 0 to below pi/2 (radians)",
            )

    @property
    def n_directions(self) -> int:
        """N, the number of direction pairs."""
        return int(self.theta_i.size)

    @property
    def n_channels(self) -> int:
        """C, the number of channels."""
        return len(self.channels)

    @property
    def n_dropped(self) -> int:
        """Rows of the file that a rule removed."""
        return sum(entry.count for entry in self.dropped)

    @property
    def n_merged(self) -> int:
        """Rows of the file averaged into another row of the same direction."""
        return self.rows_read - self.n_dropped - self.n_directions

    @cached_property
    def positive_share(self) -> float:
        """Share of positive values among those present."""
        return self._share(self.values > 0)

    @cached_property
    def negative_share(self) -> float:
        """Share of negative values among those present."""
        return self._share(self.values < 0)

    def _share(self, mask: NDArray[np.bool_]) -> float:
        present = int(np.count_nonzero(~np.isnan(self.values)))
        return float(np.count_nonzero(mask)) / present if present else 0.0

    @cached_property
    def decades(self) -> float:
        """How many powers of ten the values span; the widest channel counts.

        From the median of the smallest hundredth of the positive values to their 99.9th
        percentile. Where there are negative values, their median magnitude is taken as the
        noise floor, since positive values below it carry no information.
        """
        return max(_span(channel) for channel in self.values)

    @cached_property
    def has_azimuthal_evidence(self) -> bool:
        """Whether the sample was turned, so that anisotropy can show.

        True with two incidence azimuths that differ by more than 1 degree modulo 180 (at
        theta_i above 1 degree), or with incidence along the normal seen from at least three
        such azimuths (at theta_o above 10 degrees). Views of every azimuth under one
        incidence azimuth are no evidence: an isotropic surface explains them.
        """
        turned = self.phi_i[self.theta_i > _POLE_REGION]
        if count_axes(turned, _AXIS_TOLERANCE) >= 2:
            return True
        seen = self.phi_o[(self.theta_i < _POLE_REGION) & (self.theta_o > _OBLIQUE)]
        return count_axes(seen, _AXIS_TOLERANCE) >= 3

    def distinct_incidences(self) -> dict[tuple[float, float], NDArray[np.intp]]:
        """Group rows by incidence.

        Returns
        -------
        dict
            ``(theta_i, phi_i)`` in radians, ascending, to the indices of its rows; angles
            within a micro-radian are one incidence.
        """
        keys = np.round(np.stack([self.theta_i, self.phi_i]) * 1e6)
        order = np.lexsort((keys[1], keys[0]))
        changes = np.any(np.diff(keys[:, order], axis=1) != 0, axis=0)
        groups = np.split(order, np.flatnonzero(changes) + 1)
        return {(float(self.theta_i[g[0]]), float(self.phi_i[g[0]])): g for g in groups}

    def select(self, index: ArrayLike | slice) -> Measurement:
        """Keep some rows.

        Parameters
        ----------
        index : slice, integer array or boolean array
            Which rows, in which order.

        Returns
        -------
        Measurement
            The subset, with the same metadata and notes; `rows_read` and `dropped` start anew.
        """
        rows = index if isinstance(index, slice) else np.asarray(index)
        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in DIRECTION_COLUMNS},
            values=self.values[:, rows],
            sigma=None if self.sigma is None else self.sigma[:, rows],
            dropped=(),
            rows_read=0,
        )

    def within(self, theta_max: float) -> Measurement:
        """Leave out grazing directions, where values are often extrapolated or noise.

        Parameters
        ----------
        theta_max : float
            Largest theta_i and theta_o that is kept, in radians.

        Returns
        -------
        Measurement
            What was left out is counted in `dropped`.

        Raises
        ------
        MeasurementError
            Nothing would be left.
        """
        keep = np.maximum(self.theta_i, self.theta_o) <= theta_max
        rule = f"theta above {np.degrees(theta_max):g}° (asked for)"
        if not keep.any():
            raise self._error(f"no row is left: all have {rule.removesuffix(' (asked for)')}")
        if keep.all():
            return self
        left_out = Dropped(rule, (), int(np.count_nonzero(~keep)))
        kept = self.select(keep)
        return replace(kept, dropped=(*self.dropped, left_out), rows_read=self.rows_read)


def _frozen(values: ArrayLike) -> NDArray[np.float64]:
    """View as contiguous read-only float64 without touching the caller's array."""
    view = np.ascontiguousarray(values, dtype=np.float64).view()
    view.setflags(write=False)
    return view


def _span(values: NDArray[np.float64]) -> float:
    positive = np.sort(values[values > 0])
    if positive.size == 0:
        return 0.0
    floor = float(np.median(positive[: max(3, positive.size // 100)]))
    negative = values[values < 0]
    if negative.size:
        floor = max(floor, float(np.median(-negative)))
    return max(0.0, float(np.log10(np.quantile(positive, 0.999) / floor)))
