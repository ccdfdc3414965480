"""From a measurement to fitted models: read, fit, rank, sample, simulate.

The parts are imported at their first use.
"""

from typing import TYPE_CHECKING

from lobefit.kernels.lazy import load_lazily

# ruff: noqa: TC004 - these are imported at their first use
if TYPE_CHECKING:
    from lobefit.fitting.batch import Batch, fit_many
    from lobefit.fitting.checks import DataCheck, DataChecks, check
    from lobefit.fitting.fit import fit
    from lobefit.fitting.instrument import Instrument
    from lobefit.fitting.measurement import Dropped, Measurement
    from lobefit.fitting.posterior import Posterior
    from lobefit.fitting.readers import read_measurement
    from lobefit.fitting.report import FitReport
    from lobefit.fitting.result import FitResult
    from lobefit.fitting.sample import sample
    from lobefit.fitting.scan_patterns import Hemisphere, InPlane
    from lobefit.fitting.scene import Decision, decide
    from lobefit.fitting.scene_file import read_scene
    from lobefit.fitting.search import SearchSettings
    from lobefit.fitting.simulate import simulate
    from lobefit.fitting.texel_batch import TexelBatch, fit_texel_file
    from lobefit.fitting.texel_result import TexelFit
    from lobefit.fitting.texels import fit_texels
    from lobefit.fitting.tradeoff import Chart, chart
    from lobefit.fitting.writers import write_measurement

__all__ = [
    "Batch",
    "Chart",
    "DataCheck",
    "DataChecks",
    "Decision",
    "Dropped",
    "FitReport",
    "FitResult",
    "Hemisphere",
    "InPlane",
    "Instrument",
    "Measurement",
    "Posterior",
    "SearchSettings",
    "TexelBatch",
    "TexelFit",
    "chart",
    "check",
    "decide",
    "fit",
    "fit_many",
    "fit_texel_file",
    "fit_texels",
    "read_measurement",
    "read_scene",
    "sample",
    "simulate",
    "write_measurement",
]

load_lazily(
    __name__,
    {
        "Batch": "batch",
        "Chart": "tradeoff",
        "DataCheck": "checks",
        "DataChecks": "checks",
        "Decision": "scene",
        "Dropped": "measurement",
        "FitReport": "report",
        "FitResult": "result",
        "Hemisphere": "scan_patterns",
        "InPlane": "scan_patterns",
        "Instrument": "instrument",
        "Measurement": "measurement",
        "Posterior": "posterior",
        "SearchSettings": "search",
        "TexelBatch": "texel_batch",
        "TexelFit": "texel_result",
        "chart": "tradeoff",
        "check": "checks",
        "decide": "scene",
        "fit": "fit",
        "fit_many": "batch",
        "fit_texel_file": "texel_batch",
        "fit_texels": "texels",
        "read_measurement": "readers",
        "read_scene": "scene_file",
        "sample": "sample",
        "simulate": "simulate",
        "write_measurement": "writers",
    },
)
