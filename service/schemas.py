"""Bodies of requests, closed and bounded: what is not named here is refused.

Numbers are finite, texts and lists have most lengths. Angles are in degrees, BRDF values in 1/sr.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    StringConstraints,
    Tag,
    model_validator,
)

__all__ = [
    "MOST_ITEMS",
    "BatchItem",
    "BatchRequest",
    "ChartRequest",
    "Directions",
    "EvaluateRequest",
    "FitRequest",
    "FitSettings",
    "Grid",
    "PosteriorRequest",
    "SimulateRequest",
    "Truth",
]

MOST_DIRECTIONS = 100_000
MOST_MODELS = 64
MOST_CHANNELS = 512
MOST_ITEMS = 1000

Name = Annotated[str, StringConstraints(min_length=1, max_length=120, pattern=r"^[\x21-\x7e]+$")]
# No control characters, which break logs and headers.
Label = Annotated[str, StringConstraints(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
Digest = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
# Neither true nor "1" is a number.
Real = Annotated[float, Field(strict=True)]
Seed = Annotated[int, Field(ge=0, lt=2**53, strict=True)]
Theta = Annotated[Real, Field(ge=0, lt=90)]
Phi = Annotated[Real, Field(ge=-720, le=720)]
Options = Annotated[dict[Name, Name], Field(max_length=16)]


def _is_list(value: object) -> str:
    # One alternative is checked, so that one error is told.
    return "list" if isinstance(value, list) else "one"


Value = Annotated[
    Annotated[Real, Tag("one")]
    | Annotated[
        list[Real], Field(min_length=1, max_length=MOST_CHANNELS, fail_fast=True), Tag("list")
    ],
    Discriminator(_is_list),
]
Models = Annotated[
    Annotated[Literal["quick", "standard", "all"], Tag("one")]
    | Annotated[
        list[Name], Field(min_length=1, max_length=MOST_MODELS, fail_fast=True), Tag("list")
    ],
    Discriminator(_is_list),
]
Params = Annotated[dict[Name, Value], Field(max_length=64)]
Metric = Literal["auto", "chi2", "relative", "log", "cube_root", "cosine_log"]
Tolerance = Annotated[Real, Field(gt=0, lt=1)]
MaxTheta = Annotated[Real, Field(gt=0, le=90)]
Group = Literal["fit", "evaluation", "albedo", "posterior"]


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=False)


class PosteriorRequest(_Body):
    """How to sample the posterior of a fitted model."""

    model: Name | None = Field(None, description="Candidate to sample; the best where left out.")
    steps: Annotated[int, Field(ge=100, le=1_000_000, strict=True)] = Field(
        10_000, description="Most steps, warm-up included."
    )
    ensembles: Annotated[int, Field(ge=2, le=16, strict=True)] = 4
    walkers: Annotated[int, Field(ge=8, le=1024, strict=True)] | None = None
    noise: Literal["auto", "fit", "scaled", "given", "fixed"] = "auto"
    student: Annotated[bool, Field(strict=True)] = Field(
        False, description="Student's t instead of a Gaussian, for outliers."
    )
    saturation: Annotated[Real, Field(gt=0)] | None = Field(
        None, description="Readings at or above it, in 1/sr, lie beyond it."
    )
    floor: Real | None = Field(None, description="Readings at or below it, in 1/sr, lie beyond it.")


class FitSettings(_Body):
    """How to fit."""

    models: Models = Field("standard", description="A set of candidates, or their names.")
    metric: Metric = Field("auto", description="How residuals are weighed.")
    options: Options = Field(
        default_factory=dict, description='Choices of the models, as {"fresnel": "f82"}.'
    )
    tolerance: Tolerance | None = Field(
        None, description="Relative error of radiance that does not matter."
    )
    max_theta_deg: MaxTheta | None = Field(
        None, description="Rows with theta_i or theta_o above it are left out."
    )
    posterior: PosteriorRequest | None = Field(
        None, description="How to sample the posterior; it is not sampled where left out."
    )
    seed: Seed = Field(0, description="Of the posterior.")
    name: Label | None = Field(None, description="What people call it.")


class FitRequest(FitSettings):
    """What to fit, and how."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"measurement": "0" * 64, "models": "standard"},
                {
                    "measurement": "0" * 64,
                    "models": ["ggx", "ggx:k_s=1", "ggx+ggx"],
                    "tolerance": 0.02,
                    "posterior": {"steps": 4000},
                    "seed": 7,
                },
            ]
        }
    )

    measurement: Digest = Field(description="Id of an uploaded measurement.")


class BatchItem(FitRequest):
    """A fit of a batch; what it leaves out is taken from the batch."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"measurement": "0" * 64}]})


class BatchRequest(FitSettings):
    """Measurements to fit, and how; its members are the defaults of all items."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "name": "copper, three samples",
                    "models": ["ggx", "ggx+ggx"],
                    "items": [
                        {"measurement": "0" * 64, "name": "polished"},
                        {"measurement": "0" * 64, "name": "brushed", "models": "all"},
                    ],
                }
            ]
        }
    )

    name: Label | None = Field(None, description="What people call the batch.")
    items: Annotated[
        list[BatchItem], Field(min_length=1, max_length=MOST_ITEMS, fail_fast=True)
    ] = Field(description="Each a measurement, with any member that differs for it.")

    def requests(self) -> list[FitRequest]:
        """Give the fit of each item, completed by what the batch says."""
        usual = {name: getattr(self, name) for name in FitSettings.model_fields if name != "name"}
        return [
            FitRequest.model_construct(
                **{
                    **usual,
                    "name": None,
                    **{name: getattr(item, name) for name in item.model_fields_set},
                }
            )
            for item in self.items
        ]


class Directions(_Body):
    """Pairs of directions, one per row, in degrees; both point away from the surface."""

    theta_i_deg: Annotated[
        list[Theta], Field(min_length=1, max_length=MOST_DIRECTIONS, fail_fast=True)
    ]
    phi_i_deg: Annotated[list[Phi], Field(min_length=1, max_length=MOST_DIRECTIONS, fail_fast=True)]
    theta_o_deg: Annotated[
        list[Theta], Field(min_length=1, max_length=MOST_DIRECTIONS, fail_fast=True)
    ]
    phi_o_deg: Annotated[list[Phi], Field(min_length=1, max_length=MOST_DIRECTIONS, fail_fast=True)]

    @model_validator(mode="after")
    def _same_length(self) -> Directions:
        sizes = {len(getattr(self, name)) for name in type(self).model_fields}
        if len(sizes) > 1:
            raise ValueError("the four lists of angles have different lengths")
        return self


class Grid(_Body):
    """All combinations of the angles, in degrees, phi_i = 0; the last varies fastest."""

    theta_i_deg: Annotated[list[Theta], Field(min_length=1, max_length=1024, fail_fast=True)]
    theta_o_deg: Annotated[list[Theta], Field(min_length=1, max_length=1024, fail_fast=True)]
    phi_o_deg: Annotated[list[Phi], Field(min_length=1, max_length=1024, fail_fast=True)]

    @model_validator(mode="after")
    def _bounded(self) -> Grid:
        size = len(self.theta_i_deg) * len(self.theta_o_deg) * len(self.phi_o_deg)
        if size > MOST_DIRECTIONS:
            raise ValueError(f"{size} directions; {MOST_DIRECTIONS} are the most at once")
        return self


class EvaluateRequest(_Body):
    """A model at directions or on a grid."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "model": "ggx",
                    "params": {"k_d": 0.1, "k_s": 0.8, "F0": [0.9, 0.6, 0.4], "alpha": 0.3},
                    "directions": {
                        "theta_i_deg": [30],
                        "phi_i_deg": [0],
                        "theta_o_deg": [30],
                        "phi_o_deg": [180],
                    },
                }
            ]
        }
    )

    model: Name
    params: Params = Field(default_factory=dict)
    options: Options = Field(default_factory=dict)
    directions: Directions | None = None
    grid: Grid | None = None
    precision: Literal["single", "double"] = "double"
    format: Literal["json", "exr"] = "json"

    @model_validator(mode="after")
    def _one(self) -> EvaluateRequest:
        if (self.directions is None) == (self.grid is None):
            raise ValueError("give either directions or a grid")
        if self.format == "exr" and self.grid is None:
            raise ValueError("an EXR shows a grid; give one")
        return self


class Truth(_Body):
    """A model surface, and how an instrument would measure it."""

    model: Name
    params: Params = Field(default_factory=dict)
    options: Options = Field(default_factory=dict)
    geometry: Annotated[
        str, StringConstraints(min_length=1, max_length=400, pattern=r"^[\x20-\x7e]+$")
    ] = Field("in-plane", description='Where it is measured, as "in-plane incidences=0,30 step=5".')
    noise: tuple[Annotated[Real, Field(ge=0, le=10)], Annotated[Real, Field(ge=0, le=1e6)]] = Field(
        (0.02, 0.001), description="Relative, and additive in 1/sr."
    )
    seed: Seed = Field(0, description="Of the noise.")


class SimulateRequest(Truth):
    """The measurement that an instrument would give of a model surface."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "model": "lambert",
                    "params": {"k_d": [0.5, 0.4, 0.3]},
                    "geometry": "in-plane incidences=0,30,60 step=5",
                    "noise": [0.02, 0.001],
                    "seed": 1,
                }
            ]
        }
    )

    sigma: Annotated[bool, Field(strict=True)] = Field(
        False, description="State the uncertainty in sigma_ columns."
    )


class ChartRequest(_Body):
    """What to measure speed against accuracy on: a measurement, or a known truth."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"measurement": "0" * 64, "groups": ["fit"], "models": "standard"},
                {
                    "truth": {"model": "ggx", "params": {"k_d": 0.1, "alpha": 0.3}},
                    "groups": ["fit", "evaluation"],
                    "repeats": 3,
                },
            ]
        }
    )

    measurement: Digest | None = Field(
        None,
        description="Id of an uploaded measurement: every second part of it is held back, and the "
        "error of a fit to the others is how far it is off there. Either this or `truth`.",
    )
    truth: Truth | None = Field(
        None,
        description="A surface that is simulated: the error is how far a fit to the noisy "
        "readings is off the truth. Either this or `measurement`.",
    )
    models: Models = Field("all", description="A set of candidates, or their names.")
    metric: Metric = Field("auto", description="The usual one; others are among the choices.")
    tolerance: Tolerance = Field(0.02, description="Relative error of a prediction that would do.")
    groups: Annotated[list[Group], Field(min_length=1, max_length=4)] = Field(
        ["fit", "evaluation", "albedo", "posterior"],
        description="Which choices to measure; how to fit is always among them.",
    )
    repeats: Annotated[int, Field(ge=1, le=50, strict=True)] = Field(
        5, description="Timed runs of each choice."
    )
    seed: Seed = Field(0, description="Of the posteriors.")
    max_theta_deg: MaxTheta | None = Field(
        None,
        description="Rows with theta_i or theta_o above it are left out; of a measurement only.",
    )
    name: Label | None = Field(None, description="What people call it.")
