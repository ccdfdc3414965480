"""The pages of the models are what `make docs` makes now, and nothing is left over."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from docs import picture
from docs.make import FOLDER, current, digest, expected, make
from lobefit.kernels import Model, evaluate, get_model, models

REMEDY = "run `make docs`"
LARGEST_BYTES = 40_000

every_model = pytest.mark.parametrize("name", list(models()))


def test_there_is_a_page_and_a_picture_of_every_model_and_no_other() -> None:
    wanted = {*expected(), *(f"{name}.png" for name in models())}
    assert {path.name for path in FOLDER.iterdir()} == wanted, REMEDY


@pytest.mark.parametrize("name", list(expected()))
def test_a_page_is_current(name: str) -> None:
    assert (FOLDER / name).read_text(encoding="utf-8") == expected()[name], REMEDY


@every_model
def test_a_picture_is_current_and_small(name: str) -> None:
    assert current(get_model(name)), REMEDY
    data = (FOLDER / f"{name}.png").read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    assert struct.unpack(">II", data[16:24]) == (picture.WIDTH, picture.HEIGHT)
    assert len(data) <= LARGEST_BYTES


@every_model
def test_a_page_names_everything_of_the_record(name: str) -> None:
    model, text = get_model(name), (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    for p in model.parameters:
        assert f"| `{p.name}` | {p.unit} |" in text
    for option, choices in model.lobe.options.items():
        assert f"| `{option}` | `{choices[0]}` |" in text
        assert all(f"`{choice}`" in text for choice in choices)
    for choice in model.lobe.choices.values():
        assert all(f"| `{p.name}` | {p.unit} |" in text for p in choice.parameters)
    for variant in model.variants:
        assert f"`{name}:{variant.name}`" in text
    for reference in model.lobe.references:
        assert f"| {reference.value:.10g} |" in text
    # The formula stays as it is set.
    formula = model.page.partition("Formula\n-------\n")[2].partition("\n\nConvention\n")[0]
    assert f"```text\n{formula.rstrip()}\n```" in text


def test_only_what_is_stale_is_made_again(tmp_path: Path) -> None:
    drawn: list[str] = []

    def draw(model: Model, path: Path) -> None:
        drawn.append(model.name)
        path.write_bytes(b"picture")

    everything = {*expected(), *(f"{name}.png" for name in models())}
    assert set(make(tmp_path, draw)) == everything
    assert drawn == list(models())
    assert make(tmp_path, draw) == ()

    (tmp_path / "ggx.png").unlink()
    (tmp_path / "ward.md").unlink()  # with it the digest is lost
    page = tmp_path / "lambert.md"
    page.write_text(page.read_text(encoding="utf-8") + "A remark.\n", encoding="utf-8")
    (tmp_path / "gone.md").write_text("", encoding="utf-8")
    (tmp_path / "gone.png").write_bytes(b"")
    drawn.clear()
    changed = {"gone.md", "gone.png", "ggx.png", "ward.png", "ward.md", "lambert.md"}
    assert set(make(tmp_path, draw)) == changed
    assert drawn == ["ggx", "ward"]
    assert {path.name for path in tmp_path.iterdir()} == everything

    page = tmp_path / "blinn_phong.md"
    stale = page.read_text(encoding="utf-8").replace(digest(get_model("blinn_phong")), "0" * 16)
    page.write_text(stale, encoding="utf-8")
    assert set(make(tmp_path, draw)) == {"blinn_phong.png", "blinn_phong.md"}


def test_the_digest_follows_the_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    before = digest(get_model("ggx"))
    assert digest(get_model("ward")) != before
    monkeypatch.setattr(picture, "VERSION", picture.VERSION + 1)
    assert digest(get_model("ggx")) != before


def test_a_picture_shows_light_and_shadow(tmp_path: Path) -> None:
    from PIL import Image

    picture.draw(get_model("ggx"), tmp_path / "ggx.png")
    with Image.open(tmp_path / "ggx.png") as image:
        assert image.mode == "P"
        shown = image.convert("RGB")
    assert shown.size == (picture.WIDTH, picture.HEIGHT)
    pixels = [
        shown.getpixel((picture.MARGIN + x, picture.TOP + y))
        for x in range(0, picture.DIAMETER, 4)
        for y in range(0, picture.DIAMETER, 4)
    ]
    levels = [sum(p) / 3 for p in pixels if isinstance(p, tuple)]
    assert max(levels) > 200  # the highlight
    assert min(levels) < 10  # the side that no lamp reaches


@every_model
def test_parameters_of_a_picture_are_legal_and_give_light(name: str) -> None:
    model = get_model(name)
    params = picture.shown_parameters(model)
    assert set(params) == {p.name for p in model.parameters}
    assert evaluate(model, params, 0.7, 0.0, [0.7, 0.7], [0.0, 3.14]).max() > 0.005
