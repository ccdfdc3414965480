"""F1, F16 to F21: measurements that are not what a fit takes them for."""

from __future__ import annotations

from tests.stability.modes import Mode

__all__ = ["ROWS"]

HERE = "tests/stability/test_data.py::"
MEASUREMENT = "tests/fitting/test_measurement.py::"
LOBES = "tests/fitting/test_lobes.py::"
ERRORS = "tests/fitting/test_uncertainty.py::"
CHECKS = "tests/fitting/test_data_checks.py::"

ROWS = [
    Mode(
        id="F1",
        title="noise divided by the cosine at grazing angles",
        naive="Scans to 89 degrees whose noise is 1 % of the largest f cos(theta_o): unweighted "
        "least "
        "squares has k_d wrong by {plain:.1%} rms.",
        how="curve_fit of GGX with k_s = 1, 12 seeds",
        figures={"plain": 0.068, "fit": 0.065, "within": 0.0205, "sigma": 0.0102},
        lobefit="By default no better ({fit:.1%}): the estimated noise has a relative and a "
        "constant "
        "part, none that grows with 1/cos. `check` says that scans are rough beyond 80 degrees; "
        "--max-theta 80 leaves grazing rows out and counts them ({within:.1%}); a stated noise "
        "is divided by the cosine with the value ({sigma:.1%}).",
        status="partly",
        tests=(
            f"{HERE}test_grazing",
            f"{MEASUREMENT}test_within_leaves_out_grazing_directions_and_counts_them",
            "tests/fitting/test_csv_reader.py::test_quantities_become_brdf",
            "tests/service/test_cli.py::test_fit_leaves_out_grazing_angles_when_asked",
        ),
    ),
    Mode(
        id="F16",
        title="a peak off the mirror direction, a veil, other artefacts",
        naive="A sample tilted by 0.5 degrees: F0 is off by {sigmas:.0f} of its stated errors, "
        "without a "
        "word. A veil of 0.02 1/sr adds {veil:.0%} to k_d = 0.1.",
        how="curve_fit of GGX with the true sigma; the veil in Lobefit itself",
        figures={"sigmas": 65.5, "veil": 0.625},
        lobefit="The tilted fit is misfit-limited with its worst angles, and the check of the "
        "peak's "
        "place gives the tilt (0.47 degrees; 0.5 for alpha 0.1; of peaks wider than 30 degrees it "
        "cannot tell). Asked for (`--tilt`, `--veil`), both are fitted with their errors, and F0, alpha "
        "and k_d are right within theirs; a veil is a constant of the signal, since one of f itself "
        "cannot be told from a diffuse term.",
        status="handled",
        tests=(
            f"{HERE}test_shifted_peak",
            f"{HERE}test_shifted_peak_and_veil_are_fitted_when_asked_for",
            f"{CHECKS}test_a_shifted_peak",
        ),
    ),
    Mode(
        id="F17",
        title="saturated readings",
        naive="Clipped at half the peak: alpha comes out {wide:.0%} too large, {sigmas:.0f} of "
        "its stated "
        "errors.",
        how="curve_fit of GGX, unweighted; 16 of 644 values clipped",
        figures={"wide": 0.506, "sigmas": 18.0},
        lobefit='`check` finds the plateau and counts it; the fit is misfit-limited "at the mirror '
        'direction", alpha within 5 %. The posterior takes clipped values for lower bounds '
        "(`saturation=`): alpha is right within its error.",
        status="handled",
        tests=(f"{HERE}test_saturation", f"{CHECKS}test_saturation"),
    ),
    Mode(
        id="F18",
        title="the gap around the light, where the detector stands",
        naive="Interpolated over a gap of ±5 degrees, a retro-reflector's peak is {low:.0%} too "
        "low.",
        how="numpy.interp along theta_o at 30 degrees",
        figures={"low": 0.395},
        lobefit="Only what was measured counts; lobes.exr has NaN there beside the model's "
        "value; the "
        "check names the gap and its width. That a prediction inside is extrapolated is not said "
        "with it.",
        status="partly",
        tests=(
            f"{HERE}test_retro_gap",
            f"{CHECKS}test_the_direction_of_the_light",
            "tests/fitting/test_scan_patterns.py::test_views_behind_the_detector_are_left_out",
            f"{LOBES}test_missing_readings_are_nan_and_shared_cells_are_averaged",
        ),
    ),
    Mode(
        id="F19",
        title="negative values after dark subtraction",
        naive="{share:.0%} of a dark surface's values are noise below zero. Left out, k_d is "
        "{dropped:.2f} "
        "times too large; clamped at 0, {clamped:.2f}; by the logarithm, {logarithm:.2f}.",
        how="means of a Lambert surface, k_d 0.003, noise 0.002 1/sr",
        figures={"share": 0.314, "dropped": 2.05, "clamped": 1.407, "logarithm": 1.403},
        lobefit="They stay, in a Gaussian likelihood: k_d within its error. Fill values such as "
        "-1 or "
        "-999 are told from noise and noted; --metric log counts what it leaves out.",
        status="handled",
        tests=(
            f"{HERE}test_negative_values",
            f"{CHECKS}test_negative_values",
            "tests/fitting/test_fit.py::test_negative_values_do_not_bias_a_dark_surface",
            "tests/fitting/test_csv_reader.py::test_a_fill_value_is_missing",
            "tests/fitting/test_csv_reader.py::test_negative_values_from_dark_subtraction_stay",
        ),
    ),
    Mode(
        id="F20",
        title="noise that is no constant",
        naive="5 % of the value and 0.001 1/sr, fitted with a constant sigma: F0 and alpha are "
        "off by "
        "{F0:.1f} and {alpha:.1f} of their stated errors (rms, should be 1).",
        how="curve_fit of GGX, 30 seeds",
        figures={"F0": 4.4, "alpha": 4.9},
        lobefit="Both parts are estimated with the fit: 1 within the scatter of 30 seeds; "
        "residuals by "
        "decade of the value are in the report.",
        status="handled",
        tests=(
            f"{HERE}test_noise_of_two_parts",
            "tests/fitting/test_noise.py::test_both_scales_are_recovered",
            f"{ERRORS}test_estimated_noise_gives_the_errors_of_the_stated_one",
        ),
    ),
    Mode(
        id="F21",
        title="another quantity or unit than declared",
        naive="Reflectance factors taken for a BRDF: the mean gives k_d = {k_d:.2f}, which no "
        "surface has, "
        "and nothing says so.",
        how="numpy mean of a Lambert surface, k_d 0.8",
        figures={"k_d": 2.513},
        lobefit="The fit tells an albedo above 1 and the factor pi; `check` tells a factor pi or "
        "a cosine "
        "and what to declare, or that it cannot tell (dark samples); radians read as degrees are "
        "refused.",
        status="handled",
        tests=(
            f"{HERE}test_wrong_quantity",
            f"{CHECKS}test_a_factor_pi_shows_where_the_albedo_exceeds_1",
            f"{CHECKS}test_units",
            "tests/fitting/test_fit.py::test_a_wrong_quantity_shows_in_the_albedo",
            "tests/fitting/test_csv_reader.py::test_radians",
            "tests/kernels/test_bad_calls.py::test_zenith_angles_in_degrees_or_negative",
        ),
    ),
]
