"""report.json: strict, complete, and the same after a round trip."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobefit import __version__
from lobefit.fitting import fit, simulate
from lobefit.fitting.document import SCHEMA, report_document, to_json
from lobefit.fitting.measurement import Dropped
from lobefit.kernels import evaluate, get_model
from tests.fitting.reports import (
    GLOSSY,
    hand_made_report,
    hand_made_result,
    simulated,
    strict,
)


def test_document_is_complete_and_survives_json() -> None:
    m = replace(
        simulated("in-plane", ["R", "G", "B"]),
        source="copper.csv",
        rows_read=200,
        dropped=(Dropped("at or below the horizon", (8, 11), 2),),
        notes=("two rows averaged",),
    )
    best = hand_made_result(m, "ggx:k_s=1", GLOSSY)
    report = hand_made_report(
        m,
        best,
        hand_made_result(m, "lambert", {}, bic=-1000.0),
        settings={"models": "ggx:k_s=1,lambert", "metric": "auto", "device": None, "sha256": "ab"},
    )

    document = report_document(report)
    back = strict(to_json(document))

    assert back == document
    assert back["schema"] == SCHEMA == "lobefit.report/1"
    assert back["best"] == "ggx:k_s=1"
    assert back["settings"] == {"models": "ggx:k_s=1,lambert", "metric": "auto", "device": None}
    assert back["versions"]["lobefit"] == __version__
    for package in ("numpy", "nlopt", "pyopencl"):
        assert back["versions"][package] == version(package)
    assert back["device"] == "a device"
    measured = back["measurement"]
    assert (measured["file"], measured["sha256"]) == ("copper.csv", "ab")
    assert [c["name"] for c in measured["channels"]] == ["R", "G", "B"]
    assert measured["rows"] == {
        "read": 200,
        "used": m.n_directions,
        "dropped": 2,
        "merged": 198 - m.n_directions,
    }
    assert measured["dropped"] == [
        {"rule": "at or below the horizon", "count": 2, "first_lines": [8, 11]}
    ]
    assert measured["notes"] == ["two rows averaged"]
    assert measured["metadata"] == m.metadata
    assert back["checks"] == report.checks.to_dict()
    first, second = back["results"]
    assert [c["name"] for c in first["checks"]["checks"]] == ["energy", "model reciprocity"]
    assert first["params"] == best.params
    assert first["convention"] == get_model("ggx").lobe.convention
    assert len(first["estimates"]) == len(best.estimates)
    assert first["covariance"] == best.covariance.tolist()
    per_channel = [f"{name}[{c}]" for name in ("k_d", "F0") for c in "RGB"]
    assert first["covariance_of"] == [*per_channel, "alpha"]
    assert len(first["covariance"]) == len(first["covariance_of"])
    assert first["plausibility"]["albedo_max_theta_i_deg"] == pytest.approx([85.0] * 3)
    assert second["bic_difference"] - first["bic_difference"] == 234.5
    assert back["failed"] == [{"candidate": "ward", "reason": "the sample was not turned"}]
    # A fit can be repeated from the document alone: the same parameters, the same values.
    again = evaluate(first["model"], first["params"], 0.5, 0.0, 0.3, 3.0, options=first["options"])
    np.testing.assert_array_equal(again, best.predict(0.5, 0.0, 0.3, 3.0))


def test_document_has_null_for_what_is_no_number() -> None:
    m = simulated("in-plane", ["brdf"])
    result = hand_made_result(
        m,
        "lambert",
        {},
        rmse=math.inf,
        bic=None,
        objective=math.nan,
        covariance=np.full((1, 1), np.nan),
    )
    text = to_json(report_document(hand_made_report(m, result)))
    found = strict(text)["results"][0]
    assert found["rmse"] is found["bic"] is found["bic_difference"] is found["objective"] is None
    assert found["covariance"] == [[None]]
    assert "NaN" not in text
    assert "Infinity" not in text


def test_document_of_a_channel_without_values() -> None:
    m = simulated("in-plane", ["a", "b"])
    values = m.values.copy()
    values[1] = np.nan
    blind = replace(m, values=values)
    document = report_document(hand_made_report(blind, hand_made_result(blind, "lambert", {})))
    assert document["measurement"]["channels"][1] == {
        "name": "b",
        "values": 0,
        "negative": 0,
        "lowest": None,
        "highest": None,
    }


LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
)
TEXTS = st.text() | st.sampled_from(["[ 1,  2 ]", "[\n1,\n2\n]", "\\[\n 1\n]"])


@settings(max_examples=60)
@given(
    st.dictionaries(
        TEXTS,
        st.recursive(
            LEAVES | TEXTS,
            lambda inner: st.lists(inner) | st.dictionaries(TEXTS, inner),
            max_leaves=12,
        ),
    )
)
def test_compact_lists_change_nothing(document: dict[str, Any]) -> None:
    assert strict(to_json(document)) == document


def test_lists_of_numbers_take_one_line() -> None:
    text = to_json({"a": [1, -2.5, None, 1e-9], "b": ["x", 1], "c": [[1, 2], [3, 4]]})
    assert '"a": [1, -2.5, null, 1e-09],' in text
    assert "[3, 4]" in text


def test_the_covariance_names_what_it_is_of() -> None:
    """Of a candidate that ties one parameter to another and holds a third."""
    m = simulate("ward:isotropic", {"k_d": 0.2, "k_s": 0.3, "alpha_x": 0.2}, seed=3)
    (found,) = report_document(fit(m, "ward:isotropic"))["results"]
    assert [e["status"] for e in found["estimates"]] == ["free", "free", "free", "tied", "fixed"]
    assert found["covariance_of"] == ["k_d[brdf]", "k_s[brdf]", "alpha_x"]
    assert np.shape(found["covariance"]) == (3, 3)
