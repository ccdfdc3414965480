"""Make the pages of the models again: docs/models/NAME.md, NAME.png and the index README.md.

Run as ``python -m docs.make``. Text comes from the models' records, pictures from
`docs.picture`. A picture is drawn again only where what it shows has changed: a digest of that
is kept in a comment of the page. Pages of models that are gone are removed.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterable, Sequence
from importlib.resources import files
from pathlib import Path

from docs import picture
from lobefit.kernels import Model, Parameter, models

__all__ = ["FOLDER", "current", "digest", "expected", "index", "make", "page"]

FOLDER = Path(__file__).parent / "models"
# Pieces of cl/ that every model is compiled with.
COMMON = ("types.h", "geometry.h", "geometry.cl", "values.cl")


def digest(model: Model) -> str:
    """Tell what a picture shows: the drawing's version, the record, the formulas, shared pieces.

    Parameters
    ----------
    model : Model
        Any model.

    Returns
    -------
    str
        16 hexadecimal digits.
    """
    room = files("lobefit.kernels")
    lobes = {term.lobe.name: term.lobe for term in model.terms}
    names = [f"models/{model.name}.py", *(f"models/{name}.cl" for name in lobes)]
    names += [f"cl/{name}" for name in COMMON]
    names += [f"cl/{u}" for u in dict.fromkeys(u for lobe in lobes.values() for u in lobe.uses)]
    total = hashlib.sha256(f"{picture.VERSION}\n{model.parameters!r}".encode())
    for name in names:
        total.update(f"\n{name}\n".encode() + (room / name).read_bytes())
    return total.hexdigest()[:16]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    cells = [[cell.replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def _prose(text: str) -> str:
    """Turn the paragraphs of a docstring into Markdown; indented ones stay as they are set."""
    parts = []
    for paragraph in re.split(r"\n\s*\n", text):
        lines = paragraph.splitlines()
        if all(line.startswith("    ") for line in lines):
            parts.append(f"```text\n{paragraph}\n```")
        elif any(line.startswith("- ") for line in lines):
            parts.append(_escaped(paragraph))
        else:
            # On one line, where no word can begin a list by standing first.
            parts.append(_escaped(" ".join(line.strip() for line in lines)))
    return "\n\n".join(parts)


def _escaped(text: str) -> str:
    """Escape what Markdown would take for emphasis or a tag, outside of code."""
    pieces = text.replace("``", "`").split("`")
    pieces[::2] = [re.sub(r"[*\\]|<(?=[\w/!?])", r"\\\g<0>", piece) for piece in pieces[::2]]
    return "`".join(pieces)


def _sections(text: str) -> tuple[str, dict[str, str]]:
    """Split a manual page into what stands before the first section and the sections."""
    parts = re.split(r"^(\S.*)\n-{3,}\n", text, flags=re.MULTILINE)
    return parts[0].strip(), {
        title: body.strip("\n") for title, body in zip(parts[1::2], parts[2::2], strict=True)
    }


def _bounds(p: Parameter) -> str:
    low, high = p.bounds
    if p.period is not None:
        return f"{low:g} to {high:g}, periodic"
    return f"{low:g} to {high:g}" if math.isfinite(high) else f"from {low:g}"


YES = {True: "yes", False: "no"}
PARAMETER_HEAD = ("name", "unit", "meaning", "bounds", "default", "linear", "per channel")


def _parameter(p: Parameter) -> tuple[str, ...]:
    given = (f"`{p.name}`", p.unit, _escaped(p.meaning), _bounds(p), f"{p.default:g}")
    return (*given, YES[p.linear], YES[p.per_channel])


def _options(model: Model) -> str:
    lobe = model.lobe
    rows = [
        (f"`{option}`", f"`{choices[0]}`", ", ".join(f"`{c}`" for c in choices[1:]) or "none")
        for option, choices in lobe.options.items()
    ]
    text = _table(("option", "default", "other choices"), rows)
    defaults = {choices[0] for choices in lobe.options.values()}
    brought = [
        (f"`{name}`", *_parameter(p))
        for name, choice in lobe.choices.items()
        if name not in defaults
        for p in choice.parameters
    ]
    if brought:
        table = _table(("choice", *PARAMETER_HEAD), brought)
        text += f"\n\nParameters that the other choices bring:\n\n{table}"
    return text


def _variants(model: Model) -> str:
    rows = []
    for v in model.variants:
        what = [f"`{name}` = {value:g}" for name, value in v.fixed.items()]
        what += [f"`{name}` = `{other}`" for name, other in v.tied.items()]
        what += [f"`{name}` `{value}`" for name, value in v.options.items()]
        sets = model.sets if v.sets is None else v.sets
        rows.append((f"`{model.name}:{v.name}`", ", ".join(what), ", ".join(sets) or "none"))
    return _table(("candidate", "with", "sets"), rows)


def _sums(model: Model) -> str:
    rows = []
    for partner, sets in model.lobe.partners.items():
        rows.append((f"`{model.name}+{partner}`", ", ".join(sets) or "none"))
    return _table(("candidate", "sets"), rows)


def _references(model: Model) -> str:
    rows = []
    for r in model.lobe.references:
        given = [f"{name} = {value:g}" for name, value in r.params.items()]
        given += [f"{name} {choice}" for name, choice in r.options.items()]
        angles = [f"{a:g}" for a in (r.theta_i, r.phi_i, r.theta_o, r.phi_o)]
        rows.append((", ".join(given), *angles, f"{r.value:.10g}", _escaped(r.source)))
    head = ("parameters", "theta_i", "phi_i", "theta_o", "phi_o", "f [1/sr]", "source")
    return f"Angles in degrees.\n\n{_table(head, rows)}"


def page(model: Model) -> str:
    """Write the page of a model.

    Parameters
    ----------
    model : Model
        Any registered model, its options not chosen.

    Returns
    -------
    str
        Markdown; the digest of the picture is in its first line.
    """
    lobe = model.lobe
    summary, sections = _sections(model.page)
    parts = [
        f"<!-- Made by `make docs` from kernels/models/{model.name}.py; picture {digest(model)} -->",
        f"# {model.name}",
        _prose(summary),
        f"![{model.name}: a lit sphere and the lobe in the plane of incidence]({model.name}.png)",
        "How the picture is made: [README.md](README.md#the-pictures).",
    ]
    for title, body in sections.items():
        text = f"```text\n{body}\n```" if title == "Formula" else _prose(body)
        parts.append(f"## {title}\n\n{text}")
    flags = [
        ("reciprocal", YES[model.reciprocal]),
        ("isotropic", YES[model.isotropic]),
        ("energy", _escaped(lobe.energy)),
        ("diffuse term", "`lambert` is added" if lobe.diffuse else "none is added"),
        ("candidate sets", ", ".join(model.sets) or "none; fitted where it is named"),
        ("convention", _escaped(lobe.convention)),
        ("source", _escaped(lobe.source)),
    ]
    parts.append(f"## Properties\n\n{_table(('property', ''), flags)}")
    parameters = _table(PARAMETER_HEAD, map(_parameter, model.parameters))
    parts.append(f"## Parameters\n\n{parameters}")
    if lobe.options:
        parts.append(f"## Options\n\n{_options(model)}")
    if model.variants:
        parts.append(f"## Variants\n\n{_variants(model)}")
    if lobe.partners:
        parts.append(f"## Sums\n\n{_sums(model)}")
    parts.append(f"## Reference values\n\n{_references(model)}")
    return "\n\n".join(parts) + "\n"


PICTURES = """## The pictures

{sphere}

The numbers below each sphere are the parameters of both halves of the picture; what is not
listed is 0. They are the defaults, with a coloured diffuse term, F0 = 0.5 and different widths for anisotropic
lobes; a lobe that would be invisible or too bright is scaled."""


def index(known: Iterable[Model]) -> str:
    """Write the table of all models, and how their pictures are made."""
    rows = []
    for m in known:
        energy = _escaped(m.lobe.energy)
        flags = [
            "reciprocal" if m.reciprocal else "not reciprocal",
            "isotropic" if m.isotropic else "anisotropic",
        ]
        options = "; ".join(
            f"{name}: {', '.join(f'`{c}`' for c in choices)}"
            for name, choices in m.lobe.options.items()
        )
        rows.append(
            (
                f"[{m.name}]({m.name}.md)",
                _escaped(m.title),
                ", ".join(flags),
                energy,
                ", ".join(m.sets),
                options,
            )
        )
    head = ("model", "", "flags", "energy", "sets", "options")
    camera = (picture.__doc__ or "").partition("\n\n")[2].strip()
    return (
        "\n\n".join(
            [
                "<!-- Made by `make docs` from kernels/models/; do not edit. -->",
                "# The models",
                "`lobefit models NAME` prints the text of a page.",
                _table(head, rows),
                PICTURES.format(sphere=camera),
            ]
        )
        + "\n"
    )


def expected() -> dict[str, str]:
    """Give the text of every file of the folder by its name."""
    known = models()
    return {"README.md": index(known.values())} | {f"{n}.md": page(m) for n, m in known.items()}


def current(model: Model, folder: Path = FOLDER) -> bool:
    """Tell whether the picture in a folder shows the model as it is now."""
    text, drawn = folder / f"{model.name}.md", folder / f"{model.name}.png"
    if not (text.is_file() and drawn.is_file()):
        return False
    with text.open(encoding="utf-8") as lines:
        return f"picture {digest(model)} " in lines.readline()


def make(
    folder: Path = FOLDER, draw: Callable[[Model, Path], None] = picture.draw
) -> tuple[str, ...]:
    """Bring a folder up to date.

    Parameters
    ----------
    folder : Path
        Where the pages are.
    draw : callable
        Draws a model and writes the picture.

    Returns
    -------
    tuple of str
        Names of the files that were written or removed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    known, texts, changed = models(), expected(), []
    wanted = {*texts, *(f"{name}.png" for name in known)}
    for path in sorted(folder.iterdir()):
        if path.name not in wanted and path.suffix in (".md", ".png"):
            path.unlink()
            changed.append(path.name)
    for name, text in texts.items():
        model = known.get(name.removesuffix(".md"))
        if model is not None and not current(model, folder):
            # Before the page, whose digest says that the picture is there.
            draw(model, folder / f"{model.name}.png")
            changed.append(f"{model.name}.png")
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            changed.append(name)
    return tuple(changed)


def main() -> None:
    """Make what is missing or stale, and say what that was."""
    for name in make():
        print(f"docs/models/{name}")


if __name__ == "__main__":
    main()
