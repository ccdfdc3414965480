"""ArviZ's InferenceData layout, written as NetCDF without ArviZ, which is large and slow to import."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import LobefitError

__all__ = ["Group", "InferenceData"]

Values = NDArray[Any]


@dataclass(frozen=True)
class Group:
    """One group: variables with their dimensions, coordinates and attributes.

    Attributes
    ----------
    variables : dict of str to (tuple of str, ndarray)
        Names of the dimensions, and the values.
    coords : dict of str to ndarray
        Values along dimensions, by dimension.
    attrs : dict
        Numbers and texts.
    """

    variables: dict[str, tuple[tuple[str, ...], Values]]
    coords: dict[str, Values] = field(default_factory=dict)
    attrs: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Values:
        """Give the values of a variable or coordinate."""
        return self.variables[name][1] if name in self.variables else self.coords[name]

    def __contains__(self, name: str) -> bool:
        """Tell whether there is such a variable or coordinate."""
        return name in self.variables or name in self.coords


class InferenceData:
    """Groups of variables, as attributes: ``idata.posterior["alpha"]``.

    Parameters
    ----------
    groups : mapping of str to Group
        "posterior", "sample_stats", ...
    """

    def __init__(self, groups: Mapping[str, Group]) -> None:
        self._groups = dict(groups)

    def groups(self) -> list[str]:
        """List the names of the groups."""
        return list(self._groups)

    def __getitem__(self, name: str) -> Group:
        """Give a group."""
        return self._groups[name]

    def __getattr__(self, name: str) -> Group:
        """Give a group."""
        try:
            return self.__dict__["_groups"][name]  # type: ignore[no-any-return]
        except KeyError:
            raise AttributeError(f"there is no group {name!r}") from None

    def __repr__(self) -> str:
        """Name the groups and their variables."""
        lines = [f"  {name}: {', '.join(g.variables)}" for name, g in self._groups.items()]
        return "\n".join(["InferenceData", *lines])

    def to_netcdf(self, path: str | Path) -> Path:
        """Write everything to a NetCDF 4 file, which `arviz.from_netcdf` reads.

        Raises
        ------
        LobefitError
            The file cannot be written.
        """
        import h5netcdf

        try:
            with h5netcdf.File(Path(path), "w") as file:
                for name, group in self._groups.items():
                    _write(file.create_group(name), group)
        except OSError as error:
            raise LobefitError(f"{path} cannot be written: {error}") from error
        return Path(path)


def _write(target: Any, group: Group) -> None:
    sizes: dict[str, int] = {}
    for dims, values in group.variables.values():
        sizes |= dict(zip(dims, values.shape, strict=True))
    target.dimensions = sizes
    coords = {name: ((name,), values) for name, values in group.coords.items()}
    for name, (dims, values) in {**coords, **group.variables}.items():
        if values.dtype.kind in "US":
            import h5py

            created = target.create_variable(name, dims, dtype=h5py.string_dtype())
            created[...] = values.astype(object)
        else:
            stored = values.astype(np.int8) if values.dtype == bool else values
            large = stored.size > 4096
            created = target.create_variable(
                name, dims, data=stored, **({"compression": "gzip"} if large else {})
            )
    for name, value in group.attrs.items():
        target.attrs[name] = int(value) if isinstance(value, bool) else value
