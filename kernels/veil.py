"""Veiling light: a constant part of an instrument's signal, as a term beside a model's lobes.

It is no BRDF, and no model by itself: what an instrument divides the signal by gives it its
angles. Stray light of a constant flux appears in a BRDF as 1/cos(theta_o), light of a constant
radiance (under a beam wider than the field of view) as 1/cos(theta_i).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

from lobefit.kernels.candidates import Candidate
from lobefit.kernels.library import Lobe, Parameter
from lobefit.kernels.registry import Model, Term

__all__ = ["VEIL", "with_veil"]

VEIL = "veil"
"""Name of the term's parameter, which is linear and belongs to each channel."""

TEXT = """
typedef struct {{ int unused; }} {name}_constants;
static inline {name}_constants {name}_prepare(const {name}_parameters p) {{
  const {name}_constants c = {{0}};
  return c;
}}
static inline void {name}_basis(const geometry g, const {name}_constants c, real *basis) {{
  basis[0] = 1.0 / g.{cosine};
}}
"""


@cache
def _term(cosine: str) -> Term:
    name = f"veil_{cosine}"
    lobe = Lobe(
        name=name,
        title="veiling light",
        convention=f"f {cosine} = veil",
        source="a constant part of the signal",
        energy="no reflection",
        parameters=(
            Parameter(
                name=VEIL,
                unit="1/sr",
                meaning=f"veiling light, as f {cosine}",
                bounds=(0.0, math.inf),
                default=0.0,
                linear=True,
                per_channel=True,
            ),
        ),
        coefficients=((VEIL,),),
        reciprocal=False,
        isotropic=True,
        diffuse=False,
        references=(),
        formula=TEXT.format(name=name, cosine=cosine),
    )
    return Term(lobe)


@cache
def _veiled(model: Model, cosine: str) -> Model:
    return Model(model.name, (*model.terms, _term(cosine)), model.records, model.page)


def with_veil(candidate: Candidate, cosine: str) -> Candidate:
    """Put veiling light beside a candidate's lobes.

    Parameters
    ----------
    candidate : Candidate
        Its options chosen.
    cosine : {"cos_theta_o", "cos_theta_i"}
        What the instrument divides its signal by.

    Returns
    -------
    Candidate
        With the parameter "veil" in each channel, in 1/sr: the constant part of f times the
        cosine. `get_model` does not know it; its options and name are those without.
    """
    return replace(candidate, model=_veiled(candidate.model, cosine))
