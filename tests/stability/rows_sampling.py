"""F24 to F30: emcee used plainly."""

from __future__ import annotations

from tests.stability.modes import Mode

__all__ = ["ROWS"]

HERE = "tests/stability/test_sampling.py::"

ROWS = [
    Mode(
        id="F24",
        title="walkers that start in one point or on a line",
        naive='Identical or collinear walkers are refused ({refused:.0f} of 2: "large condition '
        'number"), but a ball of 1e-10 about a point 5 standard deviations away passes and has '
        "moved by {left:.1e} after 30 steps.",
        how="emcee 3.1, 16 walkers, Gaussian in 3 dimensions",
        figures={"refused": 2, "left": 1.62e-6},
        lobefit="Walkers are drawn from the Laplace approximation about the point fit, as long "
        "as a "
        "ridge is; each ensemble is checked to span the space, else a FitError.",
        status="handled",
        tests=(f"{HERE}test_degenerate_start",),
    ),
    Mode(
        id="F25",
        title="walkers that start outside the prior",
        naive="All 16 outside: {moved:.0f} ever move in 200 steps; no error, only a numpy warning.",
        how="emcee, a Gaussian cut off at 1, walkers about 3",
        figures={"moved": 0},
        lobefit="What is drawn outside is drawn again; where no point is inside, a FitError says "
        "so.",
        status="handled",
        tests=(f"{HERE}test_start_outside_the_prior",),
    ),
    Mode(
        id="F26",
        title="log-probabilities that are NaN or infinite",
        naive="NaN ends the run; +inf is accepted, and {share:.0%} of the walkers end there.",
        how="emcee, a Gaussian with +inf beyond 2 standard deviations, 400 steps",
        figures={"share": 1.0},
        lobefit="What is not finite counts as -inf and is counted.",
        status="handled",
        tests=(f"{HERE}test_density_that_is_not_finite",),
    ),
    Mode(
        id="F27",
        title="a chain shorter than it seems",
        naive="200 steps: an autocorrelation time of {short:.0f} steps is estimated, 3000 steps "
        "give "
        "{long:.0f}. emcee's AutocorrError tells; tol=0 hides it.",
        how="emcee, Gaussian in 3 dimensions, mean over the coordinates",
        figures={"short": 13.8, "long": 36.2},
        lobefit="A run goes on until it has 50 times an autocorrelation time that is stable, "
        "with R-hat "
        "below 1.01; else `converged` is False with the reason, and the chain is kept. "
        "Deviations are "
        "taken from the ensemble's mean, which a short chain cannot hide.",
        status="handled",
        tests=(f"{HERE}test_short_chain", f"{HERE}test_budget_that_is_too_small"),
    ),
    Mode(
        id="F28",
        title="modes far apart",
        naive="Two modes 20 standard deviations apart, started in one: {other:.0%} of the "
        "samples are in "
        "the other. From a wide start the mode that holds 90 % gets {found:.0%}.",
        how="emcee, 1000 steps; 3 wide starts with 32 walkers, 800 steps",
        figures={"other": 0.0, "found": 0.469},
        lobefit="Differential evolution mixes modes 20 standard deviations apart in proportion; "
        "independent ensembles in different modes are said to disagree. A mode much farther off "
        "(50 standard deviations) is not found, and nothing says so.",
        status="partly",
        tests=(f"{HERE}test_modes_apart",),
    ),
    Mode(
        id="F29",
        title="many dimensions",
        naive="Autocorrelation times of {t5:.0f}, {t20:.0f} and {t50:.0f} steps in 5, 20 and 50 "
        "dimensions, acceptance {a50:.2f} in 50.",
        how="emcee's stretch move, Gaussian, 2000 steps",
        figures={"t5": 54.7, "t20": 129.0, "t50": 193.0, "a50": 0.18},
        lobefit="Stretch, differential evolution and draws from a distribution fitted in the "
        "warm-up: "
        "less than a fifth of that in 5 and 20 dimensions.",
        status="handled",
        tests=(f"{HERE}test_dimensions",),
    ),
    Mode(
        id="F30",
        title="a density that piles up at an edge",
        naive="exp(-x / 0.01) from 0: an autocorrelation time of {tau:.0f} steps. Sampled in log x "
        "without the Jacobian the samples run away: their median is {median:.0f} instead of 0.007.",
        how="emcee, 2500 and 1000 steps",
        figures={"tau": 45.3, "median": 0.0},
        lobefit="Coordinates without edges (logarithm, logit) with their Jacobian: below 10 "
        "steps, mean "
        "and median right within 5 %.",
        status="handled",
        tests=(f"{HERE}test_density_at_an_edge",),
    ),
]
