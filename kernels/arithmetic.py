"""Other ways to compute the same: precision, width of vectors, cheaper exp and log.

Models are compiled as everywhere else, on a device that gives another width and puts another
exp2 or log2 into the program. Fits use none of it; it shows what the usual choices buy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lobefit.kernels.device import Device
from lobefit.kernels.errors import DeviceError
from lobefit.kernels.geometry import Precision
from lobefit.kernels.program import shared_text

if TYPE_CHECKING:
    import pyopencl as cl

__all__ = ["FUNCTIONS", "Arithmetic", "ArithmeticDevice", "arithmetics"]

FUNCTIONS = ("usual", "library", "native", "polynomial")
# 512 bits abort the process on some runtimes, see `Device.width`.
MOST_BITS = 256


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """A way to compute.

    Attributes
    ----------
    precision : {"single", "double"}
        Of every term.
    width : int
        Directions in a vector: 1, 4 or 8.
    functions : {"usual", "library", "native", "polynomial"}
        exp and log: what models use; the library's everywhere; the device's `native_`
        ones, of an accuracy that is its own affair (single only); polynomials of the degree
        that single precision needs.
    """

    precision: Precision
    width: int
    functions: str = "usual"

    def __str__(self) -> str:
        """Such as ``single x 8, native exp and log``."""
        name = f"{self.precision} x {self.width}"
        return name if self.functions == "usual" else f"{name}, {self.functions} exp and log"


def arithmetics(device: Device) -> list[Arithmetic]:
    """List what is worth trying on a device, the usual double precision first."""
    usual = {p: device.width(p) for p in ("double", "single")}
    found = [Arithmetic("double", usual["double"]), Arithmetic("single", usual["single"])]
    for precision, bits in (("double", 64), ("single", 32)):
        for width in (1, 4, 8):
            entry = Arithmetic("double" if bits == 64 else "single", width)
            if entry not in found and width * bits <= MOST_BITS:
                found.append(entry)
        names = ("polynomial",) if precision == "double" else ("library", "native", "polynomial")
        found += [
            Arithmetic("double" if bits == 64 else "single", usual[precision], name)
            for name in names
        ]
    return found


class ArithmeticDevice(Device):
    """The same device, context and queue, computing in another way.

    Parameters
    ----------
    device : Device
        An open one.
    arithmetic : Arithmetic
        How programs are compiled.

    Raises
    ------
    DeviceError
        Vectors of a width that is not 1, 4 or 8, or wider than is safe; functions of an
        unknown name, or native ones in double precision, which OpenCL does not have.
    """

    def __init__(self, device: Device, arithmetic: Arithmetic) -> None:
        a = arithmetic
        bits = 64 if a.precision == "double" else 32
        if a.width not in (1, 4, 8) or a.width * bits > MOST_BITS:
            raise DeviceError(f"no vectors of {a.width} x {a.precision} precision")
        if a.functions not in FUNCTIONS or (a.functions == "native" and bits == 64):
            raise DeviceError(f"no {a.functions} functions in {a.precision} precision")
        self.__dict__.update(device.__dict__)
        self.arithmetic = a

    def width(self, precision: str) -> int:
        """Directions per vector; no more than is safe."""
        return min(self.arithmetic.width, 4 if precision == "double" else 8)

    def kernel(self, source: str, name: str, options: tuple[str, ...] = ()) -> cl.Kernel:
        """Give the kernel of a program in which other functions stand."""
        functions = self.arithmetic.functions
        # The planes are the same for all: the formulas alone are compiled otherwise.
        if functions != "usual" and name != "directions_to_planes":
            head = shared_text("types.h")
            define = f"#define FUNCTIONS {FUNCTIONS.index(functions)}"
            put = f"{head}\n{define}\n{shared_text('functions.h')}"
            source = source.replace(head, put, 1)
        return super().kernel(source, name, options)
