"""Fitted models for renderers: each target is given only what it evaluates to the same BRDF.

A target that has no equal of a model, of its masking, Fresnel term or strength, refuses with the
reason and says what to fit instead. What is written carries the model's name, its convention of
normalisation and the fitted numbers as a comment.
"""

from lobefit.fitting.export.fitted import Fitted, read_fitted
from lobefit.fitting.export.refusal import ExportError
from lobefit.fitting.export.targets import TARGETS, export_text, write_export

__all__ = ["TARGETS", "ExportError", "Fitted", "export_text", "read_fitted", "write_export"]
