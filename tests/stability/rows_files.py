"""F41 to F43: OpenEXR and half precision."""

from __future__ import annotations

from tests.stability.modes import Mode

__all__ = ["ROWS"]

HERE = "tests/stability/test_files.py::"
LOBES = "tests/fitting/test_lobes.py::"

ROWS = [
    Mode(
        id="F41",
        title="OpenEXR stores strided arrays wrongly, in silence",
        naive="`numbers[:, ::3]` of a 4 by 12 array: {wrong:.0f} of 16 pixels come back as other "
        "numbers, no error (openexr#1929).",
        how="OpenEXR.File(header, channels).write, read back",
        figures={"wrong": 15},
        lobefit="Planes are made contiguous before they are written, and every file is read back "
        "and "
        "compared; a difference is a LobefitError, and no file is left.",
        status="handled",
        tests=(
            f"{HERE}test_strided",
            "tests/fitting/test_exr.py::test_strided_planes_are_stored_in_order",
            f"{LOBES}test_a_file_that_reads_back_differently_is_refused",
        ),
    ),
    Mode(
        id="F42",
        title="forged and truncated OpenEXR files",
        naive="A header of {bytes:.0f} bytes that claims 2²⁰ by 2²⁰ pixels: an array of 4 TiB is "
        "tried, "
        "MemoryError is only printed, and the picture has {parts:.0f} parts.",
        how="OpenEXR.File(path) in a process of its own",
        figures={"bytes": 336, "parts": 0},
        lobefit="The environment of a scene is opened in a process of its own with limits of size, "
        "memory and time, its header judged before any pixel; texels are read by OpenImageIO, "
        "which refuses both. What is refused is told with its file; as a measurement an EXR is "
        "refused by its first bytes.",
        status="handled",
        tests=(
            f"{HERE}test_forged",
            "tests/fitting/test_scene_file.py::test_hostile_environments_are_refused",
            "tests/fitting/test_texel_exr.py::test_hostile_files_are_refused",
        ),
    ),
    Mode(
        id="F43",
        title="half precision",
        naive="A peak of 70,000 1/sr becomes {peak}, 1e-8 becomes {dark:.0f}; values in between "
        "lose "
        "up to {loss:.2g}. DWAA loses up to {dwaa:.0%} of 32-bit values too.",
        how="numpy float16; 2,048 pixels from 0.01 to 7 through OpenEXR's DWAA",
        figures={"peak": float("inf"), "dark": 0.0, "loss": 4.69e-4, "dwaa": 0.0529},
        lobefit="lobes.exr is 32-bit and losslessly compressed.",
        status="handled",
        tests=(f"{HERE}test_half", f"{LOBES}test_lobes_hold_the_measurement_and_the_model"),
    ),
]
