"""The order of the candidates."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobefit.fitting.selection import BIC_MARGIN, RMS_MARGIN, bic, rank


def test_bic_of_independent_values_is_schwarzs() -> None:
    assert bic(100.0, 50, 50, 3) == pytest.approx(100.0 + 3 * math.log(50), rel=1e-15)


def test_bic_counts_correlated_values_once() -> None:
    """A tenth of the values being independent makes a tenth of the evidence."""
    assert bic(100.0, 500, 50, 3) == pytest.approx(10.0 + 3 * math.log(50), rel=1e-15)
    few, many = (bic(0.0, 500, 500 / tau, 3) for tau in (10, 1))
    assert few < many


def test_bic_of_a_linear_regression_prefers_the_true_degree() -> None:
    rng = np.random.default_rng(1)
    x = np.linspace(-1, 1, 200)
    y = 1 + 2 * x - 1.5 * x**2 + 0.1 * rng.standard_normal(200)
    scores = []
    for degree in range(6):
        r = y - np.polynomial.Polynomial.fit(x, y, degree)(x)
        v = np.mean(r**2)
        scores.append(bic(200 * (math.log(2 * math.pi * v) + 1), 200, 200, degree + 2))
    assert int(np.argmin(scores)) == 2


NAMES = ["lambert", "small", "middle", "large"]
SIZES = [1, 3, 4, 6]


@pytest.mark.parametrize(
    ("scores", "expected"),
    [
        ([900.0, 100.0, 106.5, 120.0], "small"),  # the best is the simplest too
        ([900.0, 105.9, 100.0, 120.0], "small"),  # within the margin the simpler one
        ([900.0, 106.0, 100.0, 120.0], "small"),  # the margin itself is within
        ([900.0, 106.1, 100.0, 120.0], "middle"),  # beyond it is not
        ([900.0, 105.0, 102.0, 100.0], "small"),  # the simplest of several
        ([-1e5, -1e5 - 50, -1e5 - 55, -1e5 - 57], "middle"),
    ],
)
def test_the_simplest_within_the_margin_is_first(scores: list[float], expected: str) -> None:
    ranked = rank(NAMES, scores, SIZES, BIC_MARGIN)
    assert ranked[0] == expected
    rest = [scores[NAMES.index(name)] for name in ranked[1:]]
    assert rest == sorted(rest)
    assert sorted(ranked) == sorted(NAMES)


def test_at_equal_size_the_better_score() -> None:
    assert rank(["a", "b"], [101.0, 100.0], [3, 3], BIC_MARGIN) == ["b", "a"]


def test_the_margins() -> None:
    assert BIC_MARGIN == 6.0  # what the documentation and the verdict promise
    assert RMS_MARGIN == 0.05


def test_infinite_scores_come_last() -> None:
    ranked = rank(NAMES, [math.inf, 100.0, math.inf, 90.0], SIZES, BIC_MARGIN)
    assert ranked[:2] == ["large", "small"]


@given(
    scores=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6),
    sizes=st.lists(st.integers(1, 20), min_size=6, max_size=6),
)
@settings(max_examples=60, deadline=None, derandomize=True, database=None)
def test_the_order_of_the_input_does_not_matter(scores: list[float], sizes: list[int]) -> None:
    rows = [(score, size) for score, size in zip(scores, sizes, strict=False)]

    def ranked(order: Sequence[tuple[float, int]]) -> list[tuple[float, int]]:
        return rank(order, [row[0] for row in order], [row[1] for row in order], BIC_MARGIN)

    first = ranked(rows)
    for order in itertools.islice(itertools.permutations(rows), 20):
        assert ranked(order) == first
    best = min(scores)
    assert first[0][0] <= best + BIC_MARGIN
    assert all(size >= first[0][1] for score, size in rows if score <= best + BIC_MARGIN)
