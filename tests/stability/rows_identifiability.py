"""F4 to F7, F23: parameters that data do not determine."""

from __future__ import annotations

from tests.stability.modes import Mode

__all__ = ["ROWS"]

HERE = "tests/stability/test_identifiability.py::"
ERRORS = "tests/fitting/test_uncertainty.py::"
KNOWN = "tests/fitting/test_identifiability.py::"

ROWS = [
    Mode(
        id="F4",
        title="a mirror peak narrower than the steps of the scan",
        naive="Beckmann with alpha 1e-4, steps of 1 degree beside the peak: chi² is the same for "
        "every "
        "alpha below 7e-4, yet least squares gives {alpha:.5f} ± {error:.0%}.",
        how="curve_fit from alpha 0.001",
        figures={"alpha": 0.0011, "error": 0.033, "wrong": 1, "stated": 1},
        lobefit="An upper limit of 95 % by profile likelihood instead of an error, and the "
        "sentence that the readings do not resolve the peak; F0 and k_s, which would follow from "
        "its width, are undetermined. Where few readings on the peak have to tell their own noise "
        "too, limits are those of Student's t: with 3 of them, {wrong:.0f} of 20 exclude the truth "
        "(with sigma given: {stated:.0f}).",
        status="handled",
        tests=(
            f"{HERE}test_peak_between_the_steps",
            f"{HERE}test_limits_from_few_readings_on_the_peak",
            f"{KNOWN}test_peak_narrower_than_the_steps_of_the_scan",
            f"{ERRORS}test_a_lobe_narrower_than_the_steps_has_no_width",
        ),
    ),
    Mode(
        id="F5",
        title="an exponent without an end",
        naive="Blinn-Phong with n = 5e5 in steps of 2 degrees: chi² is the same from 2.5e5 to "
        "1e6; least "
        "squares stops at {low:.2g} or {high:.2g}, depending on the start.",
        how="curve_fit from n = 2e5 and 1e6",
        figures={"low": 2.76e5, "high": 5.44e5},
        lobefit="A lower limit of n, and k_s n as what is known; k_s and n are undetermined, also "
        "where noise makes a dip in the flat valley (10 of 10 seeds).",
        status="handled",
        tests=(
            f"{HERE}test_saturated_exponent",
            f"{HERE}test_a_dip_in_the_flat_valley",
            f"{KNOWN}test_saturated_exponent",
        ),
    ),
    Mode(
        id="F6",
        title="k_s and F0 are one number near the normal",
        naive="Incidences up to 5 degrees, truth k_s = 1: least squares gives k_s = {low:.2f}, "
        "{middle:.2f} or {high:.1f}, depending on the start, each with the same chi².",
        how="curve_fit of GGX with the true sigma, from k_s = 0.1, 1 and 10",
        figures={"low": 0.0986, "middle": 0.987, "high": 10.1},
        lobefit='"k_s and F0 cannot be told apart; k_s F0 = 0.04018 is known to 5.3 %", F0 '
        "undetermined, and which incidence would help; with 60 degrees the warning is gone.",
        status="handled",
        tests=(
            f"{HERE}test_strength_and_f0",
            f"{KNOWN}test_report_says_that_scale_and_fresnel_cannot_be_told_apart",
            f"{KNOWN}test_advice_keeps_what_it_promises",
            f"{ERRORS}test_strength_and_f0_cannot_be_told_apart_near_the_normal",
            f"{ERRORS}test_strength_and_f0_are_told_apart_by_grazing_angles",
        ),
    ),
    Mode(
        id="F7",
        title="the diffuse part of a metal",
        naive="k_d = 0.001 under a lobe of F0 = 0.9: an error of {error:.0%}, and {negative:.0f} "
        "of 10 "
        "values of k_d are negative.",
        how="curve_fit of GGX with the true sigma, 10 seeds",
        figures={"error": 0.78, "negative": 1},
        lobefit="k_d is never negative and gets a limit of 95 % instead of an error (k_d < "
        "0.0027); the "
        "limit holds the truth in at least 8 of 10.",
        status="handled",
        tests=(
            f"{HERE}test_diffuse_part_of_a_metal",
            f"{KNOWN}test_diffuse_term_of_a_metal_is_an_upper_limit",
            f"{KNOWN}test_limits_cover_as_stated",
            f"{ERRORS}test_on_the_lower_bound_the_error_is_that_of_a_free_estimate",
        ),
    ),
    Mode(
        id="F23",
        title="a parameter at its bound",
        naive="Ward fitted to rough felt with alpha up to 0.5: alpha = {alpha:.2f} ± {error:.0f}.",
        how="curve_fit with bounds; the felt is Oren-Nayar",
        figures={"alpha": 0.5, "error": 0.0},
        lobefit='"lower bound" beside the value and in the ranking\'s flags, no error of what '
        "the data "
        "leave open; the model that fits comes first.",
        status="handled",
        tests=(
            f"{HERE}test_parameter_at_its_bound",
            f"{KNOWN}test_railing_parameter_has_a_limit_and_no_error",
            f"{ERRORS}test_on_the_upper_bound",
            f"{ERRORS}test_without_a_lobe_its_shape_is_undetermined",
            "tests/fitting/test_tables.py::test_flags_and_cautions_name_every_trouble",
        ),
    ),
]
