"""F31 to F38: NLopt used plainly."""

from __future__ import annotations

from tests.stability.modes import Mode

__all__ = ["ROWS"]

HERE = "tests/stability/test_search.py::"
GUARD = "tests/fitting/test_search.py::"

ROWS = [
    Mode(
        id="F31",
        title="NLopt's rounding error is an exception that loses the point",
        naive="COBYLA, BOBYQA and SLSQP without tolerances: {lost:.0f} of 3 raise RoundoffLimited "
        "at the minimum of a bowl and return no point.",
        how="`nlopt.opt(...).optimize(start)` on (x - 0.3)² + (y - 0.7)² + 1",
        figures={"lost": 3},
        lobefit='The objective keeps the best point itself; the reason reads "limited by rounding" '
        "and Gauss-Newton takes the last digits.",
        status="handled",
        tests=(
            f"{HERE}test_rounding",
            f"{GUARD}test_the_best_point_survives_what_nlopt_raises",
            f"{GUARD}test_rounding_ends_a_search_without_tolerances",
        ),
    ),
    Mode(
        id="F32",
        title="NaN in the objective",
        naive="An objective that is always NaN: {success:.0f} of 5 algorithms report success, "
        "COBYLA "
        "at a point of uninitialised memory, the others at the start or at NaN; none says what "
        "happened.",
        how="COBYLA, BOBYQA, SBPLX, Nelder-Mead, SLSQP; success is a positive result code",
        figures={"success": 5},
        lobefit="What is not finite reaches NLopt as a large number that grows outwards; if "
        "nothing "
        "finite was found the fit is a FitError that says so, and the other candidates go on.",
        status="handled",
        tests=(
            f"{HERE}test_nan",
            f"{GUARD}test_nothing_finite_at_all",
            f"{GUARD}test_half_of_the_box_is_not_finite",
            "tests/fitting/test_fit.py::test_a_failing_candidate_does_not_lose_the_others",
        ),
    ),
    Mode(
        id="F33",
        title="NLopt reports success at the start",
        naive="`grad = ...` instead of `grad[:] = ...`: {reached:.0f} of 3 algorithms (SLSQP, "
        "L-BFGS, "
        "MMA) reach the minimum. In a fresh process they report success after 1 or 2 "
        "evaluations, where "
        "they started; later they follow whatever stands in memory.",
        how="the same bowl; the minimum is 2.1 away from the start",
        figures={"reached": 0},
        lobefit="Cannot occur: NLopt gets no gradients (BOBYQA and Nelder-Mead); those of "
        "Gauss-Newton "
        "come from the kernels and are tested against the formula of every model.",
        status="handled",
        tests=(
            f"{HERE}test_success_at_the_start",
            "tests/kernels/test_sums.py::test_derivatives_agree_with_the_formula",
        ),
    ),
    Mode(
        id="F34",
        title="NLopt takes nothing but a Python float",
        naive="numpy float32, a 0-d array, None or text from the objective: {silent:.0f} of 4 "
        "raise an "
        "invalid_argument with an empty message, which is no ValueError.",
        how="one call of BOBYQA each",
        figures={"silent": 4},
        lobefit="Any number is a value; anything else is the TypeError or ValueError that Python "
        "has "
        "for it.",
        status="handled",
        tests=(
            f"{HERE}test_types",
            f"{GUARD}test_any_number_is_a_value",
            f"{GUARD}test_no_number_is_an_error_of_the_objective",
        ),
    ),
    Mode(
        id="F35",
        title="exceptions in global algorithms",
        naive="DIRECT-L and CRS2: a ValueError of the objective comes out as SystemError in "
        "{changed:.0f} of 2.",
        how="an objective that raises at its first call",
        figures={"changed": 2},
        lobefit="The exception that the objective raised is raised again, itself, at once; "
        "Ctrl-C too.",
        status="handled",
        tests=(
            f"{HERE}test_exceptions",
            f"{GUARD}test_an_exception_is_raised_as_it_is_and_at_once",
            "tests/fitting/test_fit.py::test_an_interrupt_within_the_search_comes_through",
        ),
    ),
    Mode(
        id="F36",
        title="SBPLX in a corner never meets its tolerances",
        naive="A minimum in the corner of a 3-D box: with xtol_rel 1e-6 it runs until the limit of "
        "{evaluations:.0f} evaluations.",
        how="x + y + z on [0, 2]³ with SBPLX",
        figures={"evaluations": 2000},
        lobefit="BOBYQA with absolute tolerances in the searched scale and always a limit of "
        "evaluations; what stopped it is in the report.",
        status="handled",
        tests=(
            f"{HERE}test_corner",
            f"{GUARD}test_a_minimum_in_the_corner_ends",
            f"{GUARD}test_the_limit_of_evaluations_is_said",
        ),
    ),
    Mode(
        id="F37",
        title="a start outside the bounds",
        naive="invalid_argument with an empty message ({evaluations:.0f} evaluations).",
        how="BOBYQA from (9, -9) in [-2, 2]²",
        figures={"evaluations": 0},
        lobefit="Starts are clipped into the bounds.",
        status="handled",
        tests=(f"{HERE}test_start_outside", f"{GUARD}test_a_start_outside_the_bounds"),
    ),
    Mode(
        id="F38",
        title="NLopt's seed belongs to a thread",
        naive="`nlopt.srand(42)` in the main thread, CRS2 in a worker: two runs end {apart:.0f} "
        "times at "
        "one and the same point (in the worker's own thread: {seeded:.0f}).",
        how="one repetition of 300 evaluations each",
        figures={"apart": 0, "seeded": 1},
        lobefit="Cannot occur: neither the start scan nor the searches draw random numbers; fits "
        "in "
        "threads give the same parameters as in turn.",
        status="handled",
        tests=(
            f"{HERE}test_seeds_in_threads",
            f"{GUARD}test_the_same_search_twice",
            "tests/kernels/test_processes.py::test_fits_in_threads",
        ),
    ),
]
