"""A device whose compiler is broken is refused before anything is believed."""

from __future__ import annotations

import re
from importlib.resources import files

import pytest

from lobefit.kernels import DeviceError, get_device
from lobefit.kernels import self_test as module
from lobefit.kernels.program import shared_text
from lobefit.kernels.self_test import FUNCTIONS, self_test


def test_this_device_passes() -> None:
    self_test(get_device())


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("#undef exp2\n#define exp2(x) exp(x)", r"computes exp2\(x\) wrongly in double precision"),
        ("#undef log1p\n#define log1p(x) (x)", r"log1p"),
        ("#undef erf\n#define erf(x) (x / (x - x))", r"erf.*(inf|nan)"),
        (
            "#if PRECISION == 32\n#undef sqrt\n#define sqrt(x) (1.0001 * (x))\n#endif",
            r"sqrt.* in single",
        ),
    ],
)
def test_a_wrong_function_is_named(monkeypatch: pytest.MonkeyPatch, broken: str, said: str) -> None:
    types = shared_text("types.h")
    monkeypatch.setattr(module, "shared_text", lambda _name: f"{types}\n{broken}\n")
    with pytest.raises(DeviceError, match=said) as caught:
        self_test(get_device())
    assert "choose another device" in str(caught.value)


def test_every_function_that_the_formulas_call_is_tried() -> None:
    """A function that a formula calls must be among those held against numpy."""
    kernels = files("lobefit.kernels")
    text = "".join(
        entry.read_text(encoding="utf-8")
        for folder in ("models", "cl")
        for entry in (kernels / folder).iterdir()
        if entry.name.endswith((".cl", ".h")) and entry.name != "geometry.cl"
    )
    builtin = r"\b(a?(?:sin|cos|tan)h?|a(?:sin|cos|tan)(?:2|pi)?|exp(?:2|10|m1)?|log(?:2|10|1p)?|"
    builtin += r"r?sqrt|cbrt|erfc?|pow[nr]?|rootn|t?l?gamma|hypot|fm(?:in|ax|od)|fabs|clamp)\("
    called = set(re.findall(builtin, re.sub(r"//.*", "", text)))
    tried = {name for f in FUNCTIONS for name in re.findall(r"([a-z]+[a-z0-9]*)\(", f)}
    assert called <= tried
    assert not called & {"pow", "pown", "powr", "rootn"}
