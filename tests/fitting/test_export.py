"""Exports: what is refused and how, what every export says, and the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from lobefit.fitting import fit, simulate
from lobefit.fitting.export import ExportError, Fitted, export_text, read_fitted, write_export
from lobefit.kernels import LobefitError
from lobefit.service.cli import app
from tests.fitting.export_cases import (
    COPPER,
    EXACT,
    METAL,
    NONE,
    RGB,
    SEPARABLE,
    close,
    directions,
    fitted,
)
from tests.fitting.export_readers import Frame, mitsuba_value

LOBE = {"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.2}
PLAIN = {"k_d": 0.1, "k_s": 0.5, "alpha": 0.2}


@pytest.mark.parametrize(
    ("case", "target", "message"),
    [
        (fitted("ggx", LOBE), "mitsuba", r"masking is smith_correlated .* --option masking=smith_"),
        (fitted("ggx", LOBE, SEPARABLE), "mitsuba", r"no Fresnel term schlick.* fresnel=conductor"),
        (fitted("ggx", LOBE), "pbrt", r"no Fresnel term schlick.*--option fresnel=conductor"),
        (
            fitted("ggx", PLAIN, SEPARABLE | NONE),
            "pbrt",
            r"masking is smith_separable and that of pbrt is smith_correlated; fit with --option",
        ),
        (fitted("cook_torrance", LOBE), "mitsuba", "masking is v_cavity"),
        (fitted("cook_torrance", LOBE), "pbrt", "no beckmann distribution; fit one of ggx"),
        (
            fitted("beckmann", PLAIN, SEPARABLE | NONE),
            "mitsuba",
            r"approximation .* up to 0.63 %; accept that with --tolerance 0.007",
        ),
        (fitted("ward", {"k_s": 0.1}), "mitsuba", r"no equal of ward; fit lambert, ggx.*--to merl"),
        (
            fitted("ggx", PLAIN | {"k_s": [0.95, 0.9, 0.9]}, SEPARABLE | NONE),
            "mitsuba",
            r"strengths .* add to 1.05, and the weights of a blend to 1",
        ),
        (
            fitted("lambert", {"k_d": 1.2}),
            "mitsuba",
            r"strengths .* add to 1.2, and the weights of a blend to 1",
        ),
        (
            fitted("lambert", {"k_d": 1.2}),
            "pbrt",
            r"its albedo k_d is 1.2 and that of pbrt at most 1",
        ),
        (fitted("ggx", PLAIN | {"k_s": 1.5}, NONE), "pbrt", r"k_s is 1.5 and the weight of a mix"),
        (
            fitted("ggx", PLAIN | {"k_s": 0.95}, NONE),
            "pbrt",
            r"k_d = 0.1 beside k_s = 0.95: .*at most 1 - k_s",
        ),
        (
            fitted("ggx", PLAIN | {"k_s": [0.5, 0.4, 0.3]}, NONE),
            "pbrt",
            r"k_s differs by channel",
        ),
        (fitted("ggx", PLAIN | {"alpha": 5e-4}, NONE), "pbrt", "for a mirror, and alpha is 0.0005"),
        (
            fitted("ggx", PLAIN | COPPER, METAL),
            "pbrt",
            r"renders spectra.*channels are wavelengths \(450nm",
        ),
        (fitted("ggx", LOBE), "materialx", r"no node of MaterialX is ggx; .*scattered several"),
        (
            fitted("oren_nayar", {"k_d": 0.5, "sigma": 1.2}),
            "materialx",
            r"sigma is 1.2 and that of MaterialX lies within 0 and 1; fit eon",
        ),
        (
            fitted("lambert", {"k_d": [0.1, 0.2]}, channels=("450nm", "550nm")),
            "materialx",
            "three channels, and these are 450nm, 550nm",
        ),
        (
            fitted("lambert", {"k_d": [0.1, 0.2]}, channels=("450nm", "550nm")),
            "merl",
            "channels R, G, B, and these are 450nm, 550nm",
        ),
        (
            fitted("ggx_anisotropic", {"alpha_x": 0.4, "alpha_y": 0.2}),
            "merl",
            "no azimuth of the surface, and the model is anisotropic; fit an isotropic",
        ),
        (fitted("phong", {}), "merl", "model is not reciprocal; fit a reciprocal"),
        *(
            (fitted("lambert", {"k_d": [0.1, 0.2]}, channels=("s", "p")), target, "neither R, G, B")
            for target in ("mitsuba", "pbrt")
        ),
    ],
)
def test_refusals_name_model_target_reason_and_remedy(
    tmp_path: Path, case: Fitted, target: str, message: str
) -> None:
    with pytest.raises(ExportError, match=message) as caught:
        write_export(case, target, tmp_path / "out")
    error = caught.value
    assert error.target == target
    assert error.reason and error.remedy
    assert str(error).startswith(f"{case.candidate} cannot be exported to {target}: ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("target", ["mitsuba", "pbrt", "materialx"])
def test_every_export_states_model_convention_and_parameters(target: str) -> None:
    case = fitted("lambert", {"k_d": [0.3, 0.2, 0.123456789]})
    text = export_text(case, target)
    assert f"convention: {case.convention}" in text
    assert "lambert, fitted by Lobefit " in text
    assert "k_d = 0.3, 0.2, 0.123456789" in text
    assert "from: copper.csv" in text


def test_a_comment_cannot_end_a_comment() -> None:
    case = fitted("lambert", {"k_d": 0.5})
    hostile = Fitted(**{**case.__dict__, "origin": "a--b---> <x/>\n-\x01.csv"})
    for target in ("mitsuba", "materialx"):
        root = ElementTree.fromstring(export_text(hostile, target))
        assert not root.findall(".//x")


def test_unknown_targets_and_texts() -> None:
    case = fitted("lambert", {"k_d": 0.5})
    with pytest.raises(LobefitError, match=r"did you mean 'mitsuba'.* pbrt, materialx, merl"):
        export_text(case, "mitsubo")
    with pytest.raises(LobefitError, match=r"name a file .*--out"):
        export_text(case, "merl")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of a fit of a metal, with the masking and Fresnel term of Mitsuba."""
    place = tmp_path_factory.mktemp("fit")
    options = SEPARABLE | NONE
    truth = {"k_d": 0.1, "k_s": 0.6, "alpha": 0.3}
    m = simulate("ggx", truth, options=options, channels=RGB)
    report = fit(m, models="oren_nayar,ggx", options=options)
    (place / "report.json").write_text(json.dumps(report.to_dict()))
    return place


def call(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["export", *arguments])


def test_the_command_writes_what_was_fitted(folder: Path, tmp_path: Path) -> None:
    case = read_fitted(folder)
    assert case.candidate == "ggx"
    done = call(str(folder / "report.json"), "--to", "mitsuba")
    assert done.exit_code == 0, done.output
    angles = directions()
    close(
        mitsuba_value(ElementTree.fromstring(done.stdout), Frame(angles)),
        case.evaluate(*angles),
        EXACT,
    )
    out = tmp_path / "new" / "paint.mtlx"
    done = call(str(folder), "--to", "materialx", "--model", "oren_nayar", "--out", str(out))
    assert done.exit_code == 0, done.output
    assert done.stdout.endswith("paint.mtlx\n")
    assert "oren_nayar, fitted by" in out.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--to", "pbrt"), "masking is smith_separable"),
        (("--to", "merl"), "--out"),
        (("--to", "blender"), "It can be mitsuba, pbrt, materialx, merl"),
        (("--to", "pbrt", "--model", "ward"), "no result is called 'ward'; it has ggx, oren_nayar"),
    ],
)
def test_the_command_refuses_with_status_2(
    folder: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = call(str(folder), *arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert not done.stdout
    assert done.stderr.count("\n") == 1


def test_out_is_a_file(folder: Path, tmp_path: Path) -> None:
    done = call(str(folder), "--to", "mitsuba", "--out", str(tmp_path))
    assert (done.exit_code, "is a folder; name a file" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "there is no such report"),
        ("theta_i,phi_i", "is no report.json"),
        ("[]", "its schema is None, expected 'lobefit.report/1'"),
        ('{"schema": "lobefit.report/0"}', "its schema is 'lobefit.report/0'"),
        ('{"schema": "lobefit.report/1", "results": [], "measurement": {}}', "no fitted model"),
        (
            '{"schema": "lobefit.report/1", "results": [{"candidate": "a"}], "measurement": {}}',
            "lacks 'model'",
        ),
    ],
)
def test_what_is_no_report(tmp_path: Path, content: str | None, message: str) -> None:
    path = tmp_path / "report.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(LobefitError, match=message):
        read_fitted(path)
