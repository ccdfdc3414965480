"""The closed schema: a broken model file is refused when it is loaded, and named."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import lobefit
from lobefit.kernels import Model, ModelError, models, registry

PACKAGE = Path(lobefit.__file__).parent
# By this way, since `lobefit.kernels.models` is the function of that name.
MODELS = importlib.import_module("lobefit.kernels.models")

SHARE = """\
        Parameter(
            name="F",
            unit="1",
            meaning="share",
            bounds=(0.0, 1.0),
            default=0.5,
            linear=True,
            per_channel=True,
        ),
"""

OTHER = """\
        Parameter(
            name="j",
            unit="1",
            meaning="another exponent",
            bounds=(0.5, 3.0),
            default=1.0,
            scale="log",
            nodes=8,
        ),
"""

# A record with everything in it that a record can have. Each test breaks one thing.
PROBE_PY = f'''"""A probe.

Formula
-------
f = k_d/pi + k_s (k + 1)/(2 pi) (cos_theta_i cos_theta_o)^(k - 1)

Convention
----------
Minnaert's lobe, scaled to the albedo k_s at normal incidence.

Domain
------
k from 0.5 to 3.

Source
------
M. Minnaert, The reciprocity principle in lunar photometry, 1941.

Verified against
----------------
The closed form.
"""

from lobefit.kernels.library import Choice, Lobe, Parameter, Reference, Variant

__all__ = ["LOBE"]


def reference(value, **params):
    return Reference(
        params=params, theta_i=0, phi_i=0, theta_o=0, phi_o=0, value=value, source="by hand"
    )


LOBE = Lobe(
    name="probe",
    title="A probe",
    convention="albedo at normal incidence",
    source="Minnaert 1941",
    energy="not at grazing",
    parameters=(
        Parameter(
            name="k_s",
            unit="1",
            meaning="strength",
            bounds=(0.0, 9.0),
            default=1.0,
            linear=True,
            per_channel=True,
        ),
{SHARE}        Parameter(
            name="k",
            unit="1",
            meaning="exponent",
            bounds=(0.5, 3.0),
            default=1.0,
            scale="log",
            nodes=8,
        ),
{OTHER}    ),
    coefficients=(("k_s", "F"), ("k_s",)),
    reciprocal=True,
    isotropic=True,
    sets=("all",),
    options={{"masking": ("none", "some")}},
    variants=(Variant(name="k=1", fixed={{"k": 1.0}}, tied={{"j": "k"}}),),
    references=(
        reference(1.0, k_d=0.0, k_s=1.0),
        reference(2.0, k_d=0.0, k_s=2.0),
        reference(3.0, k_d=0.0, k_s=3.0),
    ),
)
'''

BROKEN = {
    # the record's own fields are closed
    "a renamed field": ('title="A probe"', 'titel="A probe"', "titel"),
    "an unknown field": ('title="A probe"', 'title="A probe", colour="red"', "colour"),
    "a missing field": ('    source="Minnaert 1941",\n', "", "source"),
    "a renamed field of a parameter": ('meaning="strength"', 'meanng="strength"', "meanng"),
    "a missing field of a parameter": ("default=0.5,", "", "default"),
    "a renamed field of a reference": ("theta_i=0", "theta=0", "theta"),
    "a reference without its source": (', source="by hand"', "", "source"),
    "a renamed field of a variant": ("tied={", "tide={", "tide"),
    # parameters
    "a default outside its bounds": ("default=0.5", "default=1.5", "F has its default 1.5"),
    "a default that is no number": ("default=0.5", "default=float('nan')", "F has its default nan"),
    "an empty range": ("bounds=(0.0, 9.0)", "bounds=(1.0, 1.0)", "k_s has the empty range"),
    "an endless nonlinear parameter": ("(0.5, 3.0)", "(0.5, float('inf'))", "k is nonlinear"),
    "a scan of one node": ("nodes=8", "nodes=1", "scan nodes"),
    "a logarithm of zero": ("bounds=(0.5, 3.0)", "bounds=(0.0, 3.0)", "logarithmic"),
    "no unit": ('unit="1"', 'unit=""', "k_s lacks a unit"),
    "no meaning": ('meaning="strength"', 'meaning=""', "k_s lacks a unit or a meaning"),
    "a parameter named twice": ('name="j"', 'name="k"', "twice"),
    # what hangs together
    "no basis": ('coefficients=(("k_s", "F"), ("k_s",))', "coefficients=()", "no basis"),
    "an unused linear parameter": ('(("k_s", "F"), ("k_s",))', '(("k_s",),)', "exactly its linear"),
    "an unknown coefficient": ('("k_s",))', '("k_t",))', "exactly its linear"),
    "a product without its scale": ('(("k_s", "F"), ("k_s",))', '(("k_s", "F"),)', "first factor"),
    "a product of three": ('("k_s", "F"),', '("k_s", "F", "F"),', "first factor"),
    "an unknown set": ('sets=("all",)', 'sets=("standart",)', "unknown set"),
    "an unknown held parameter": ('fixed={"k"', 'fixed={"kk"', "variant"),
    "an unknown tied parameter": ('{"j": "k"}', '{"j": "kk"}', "variant"),
    "a reference of another model": ("reference(1.0, k_d=0.0", "reference(1.0, q=0.0", "reference"),
    "two references": ("        reference(3.0, k_d=0.0, k_s=3.0),\n", "", "fewer than three"),
    "axes that are no parameters": (
        "isotropic=True,",
        "isotropic=False, axes=('k', 'j', 'phi_x'),",
        "axes",
    ),
    "an option of no choice": ('("none", "some")', "()", "option"),
    "a choice that no option has": ("options={", "choices={'sum': Choice()}, options={", "brings"),
    "a choice with an unknown coefficient": (
        "options={",
        "choices={'some': Choice(factors=(('q',),))}, options={",
        "exactly its linear",
    ),
    "a variant with an unknown choice": (
        'fixed={"k"',
        'options={"masking": "sum"}, fixed={"k"',
        "variant",
    ),
    "a partner that is no model": ("options={", "partners={'gxx': ('all',)}, options={", "gxx"),
    "a partner in no set": ("options={", "partners={'lambert': ('al',)}, options={", "unknown set"),
    # the file
    "another name": ('name="probe"', 'name="prob"', "LOBE = Lobe(name='probe'"),
    "no record": ("LOBE = Lobe(", "RECORD = Lobe(", "LOBE"),
    "a record of another kind": ("LOBE = Lobe(", "LOBE = dict(", "LOBE"),
    "no page": ('"""A probe.', '""" """\n"""A probe.', "manual page lacks Formula"),
    "no formula on the page": ("\nFormula\n", "\nFormulas\n", "manual page lacks Formula"),
    "no convention on the page": ("Convention\n----------\n", "", "lacks Convention"),
    "no domain on the page": ("Domain\n------\n", "", "lacks Domain"),
    "no source on the page": ("Source\n------\n", "", "lacks Source"),
    "no proof on the page": ("Verified against\n", "Verified\n", "lacks Verified against"),
}

Load = Callable[[str, bool], dict[str, Model]]


def forget() -> None:
    """Let the next question look at the files again."""
    for remembered in (registry._lobes, registry._chosen, registry._build, models):
        remembered.cache_clear()


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Load]:
    """Load models from a folder that holds `lambert` and a file ``probe.py``."""
    folder = tmp_path / "models"
    folder.mkdir()
    for name in ("lambert.py", "lambert.cl"):
        shutil.copy(PACKAGE / "kernels" / "models" / name, folder)
    monkeypatch.setattr(registry, "files", lambda _package: tmp_path)
    monkeypatch.setattr(MODELS, "__path__", [*MODELS.__path__, str(folder)])

    def load(text: str, formula: bool = True) -> dict[str, Model]:
        (folder / "probe.py").write_text(text, encoding="utf-8")
        if formula:
            (folder / "probe.cl").write_text("// a formula", encoding="utf-8")
        importlib.invalidate_caches()
        forget()
        return models()

    yield load
    forget()
    sys.modules.pop("lobefit.kernels.models.probe", None)
    vars(MODELS).pop("probe", None)


def test_the_probe_itself_is_right(load: Load) -> None:
    known = load(PROBE_PY, True)
    assert list(known) == ["lambert", "probe"]
    assert [p.name for p in known["probe"].parameters] == ["k_d", "k_s", "F", "k", "j"]
    assert known["probe"].page.startswith("A probe.")


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_model_file_is_refused(load: Load, what: str) -> None:
    right, wrong, said = BROKEN[what]
    assert right in PROBE_PY
    with pytest.raises(ModelError) as caught:
        load(PROBE_PY.replace(right, wrong, 1), True)
    assert "models/probe.py" in str(caught.value)
    assert said in str(caught.value)


def test_a_model_without_a_formula_is_refused(load: Load) -> None:
    with pytest.raises(ModelError, match=r"models/probe\.py .*write models/probe\.cl"):
        load(PROBE_PY, False)


@pytest.mark.parametrize("name", models())
def test_registered_records_are_checked_too(name: str) -> None:
    lobe = models()[name].lobe
    lobe.check()
    with pytest.raises(ModelError, match=f"models/{name}.py has fewer than three"):
        replace(lobe, references=lobe.references[:2]).check()


def test_the_packages_models_are_the_files() -> None:
    folder = (PACKAGE / "kernels" / "models").resolve()
    records = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert set(models()) == records == {path.stem for path in folder.glob("*.cl")}


MINNAERT_CL = """
typedef struct { scalar k, norm; } minnaert_constants;

static inline minnaert_constants minnaert_prepare(const minnaert_parameters p) {
  const minnaert_constants c = {p.k, 0.5 * INV_PI * (p.k + 1.0)};
  return c;
}

static inline void minnaert_basis(const geometry g, const minnaert_constants c, real *basis) {
  basis[0] = c.norm * exp2((c.k - 1.0) * log2(g.cos_theta_i * g.cos_theta_o));
}
"""

TRY_MINNAERT = """
import math
import numpy as np
from lobefit.fitting import fit, simulate
from lobefit.kernels import candidates, evaluate, models

assert "minnaert" in models()
assert "minnaert" in [c.name for c in candidates("standard")]
params = {"k_d": 0.1, "k_s": [0.4, 0.6, 0.2], "k": 1.8}
f = evaluate("minnaert", params, 0.7, 0.0, 0.4, 2.0)
lobe = 2.8 / (2 * math.pi) * (math.cos(0.7) * math.cos(0.4)) ** 0.8
expected = 0.1 / math.pi + np.array([[0.4], [0.6], [0.2]]) * lobe
assert np.allclose(f, expected, rtol=1e-12, atol=0), f
report = fit(simulate("minnaert", params, noise=(0.01, 1e-4), seed=1), ["lambert", "minnaert"])
assert report.best.candidate == "minnaert", report
k = next(e for e in report.best.estimates if e.name == "k")
assert abs(k.value - 1.8) < 4 * k.standard_error < 0.1, report.best
"""


def test_a_model_is_two_files(tmp_path: Path) -> None:
    """Two new files in a copy of the package, and no edit, make a model that is fitted."""
    copy = tmp_path / "lobefit"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    text = PROBE_PY
    for old, new in {
        "probe": "minnaert",
        SHARE: "",
        OTHER: "",
        '(("k_s", "F"), ("k_s",))': '(("k_s",),)',
        'sets=("all",)': 'sets=("standard", "all")',
        '    options={"masking": ("none", "some")},\n': "",
        ', tied={"j": "k"}': "",
    }.items():
        assert old in text
        text = text.replace(old, new)
    (copy / "kernels" / "models" / "minnaert.py").write_text(text, encoding="utf-8")
    (copy / "kernels" / "models" / "minnaert.cl").write_text(MINNAERT_CL, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", TRY_MINNAERT],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
