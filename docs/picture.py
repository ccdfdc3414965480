"""The picture of a model: a lit sphere, and its lobes in the plane of incidence.

The same camera, lamps, exposure and axes for every model, so that pictures can be compared:

- The sphere is seen from infinitely far away. Two lamps as far: one above to the left, in front;
  one behind to the right, which lights the rim at grazing angles. No light from elsewhere. Where a
  lobe returns light to the lamp, the second lamp stands beside the camera instead.
- The azimuth of both directions counts from the sphere's circles of latitude, its axis being
  vertical: an anisotropic model looks like a part turned on a lathe.
- Radiance is f cos(theta_i) times the lamp, then an exposure and a shoulder that keeps
  highlights of 10 times the white apart, then the sRGB curve.
- The lobes are the luminance of f, over theta_o with the mirror direction's side positive.
"""

from __future__ import annotations

import io
import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import Model, directional_albedo, evaluate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from PIL import Image

__all__ = ["INCIDENCES", "LIGHTS", "VERSION", "draw", "shown_parameters"]

Array = NDArray[np.float64]
Params = dict[str, float | list[float]]

VERSION = 1  # raise it when pictures come out differently
WIDTH, HEIGHT, DPI = 900, 380, 100
BACKGROUND, INK, FAINT = "#1b1b1d", "#e6e6e6", "#4a4a4e"
COLOURS = ("#56b4e9", "#e69f00", "#f0e442")
INCIDENCES = (10, 45, 75)

DIAMETER, MARGIN, TOP = 296, 32, 34
PLOT = (0.43, 0.13, 0.55, 0.78)  # left, bottom, width, height, as shares
SUPERSAMPLING = 3
SPHERE_COLOURS = 224  # of the palette's 256
# Towards the lamps; x to the right, y up, z to the camera. The key light, the rim light, and
# what takes its place for lobes that return light.
LIGHTS = {"key": (-0.45, 0.5, 0.74), "rim": (0.86, 0.22, -0.46), "camera": (0.12, 0.08, 1.0)}
POWER = {"key": math.pi * 1.3, "rim": math.pi * 0.8, "camera": math.pi * 0.15}
WHITE = 10.0
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

COLOURED = {"k_d", "rho", "base_color"}  # albedos of the diffuse terms
DIFFUSE = [0.38, 0.13, 0.07]
F0 = 0.5
AXES = (0.4, 0.1)


def shown_parameters(model: Model) -> Params:
    """Choose parameters whose lobe is well visible, the same way for every model.

    The diffuse term gets a colour, F0 a half, an anisotropic lobe different widths, and all else
    is the record's default. Where the lobe then returns less than 5 % or more than 150 % of the
    light from 45 degrees, its linear strengths are scaled to return about 40 %.

    Parameters
    ----------
    model : Model
        Any model.

    Returns
    -------
    dict
        A value for every parameter of the model.
    """
    params: Params = {p.name: p.default for p in model.parameters}
    bounds = {p.name: p.bounds for p in model.parameters}
    if "F0" in params:
        params["F0"] = F0
    for axes in model.axes:
        for name, value in zip(axes, AXES, strict=False):
            params[name] = min(max(value, bounds[name][0]), bounds[name][1])
    strengths = {c[0] for c in model.coefficients if len(c) == 1} - {"k_d"}
    if strengths:
        dark = params | ({"k_d": 0.0} if "k_d" in params else {})
        albedo = float(directional_albedo(model, dark, math.radians(45.0)).max())
        if albedo > 1.5 or 0.0 < albedo < 0.05:
            for name in strengths:
                scaled = float(f"{float(params[name]) * 0.4 / albedo:.1g}")  # type: ignore[arg-type]
                params[name] = min(max(scaled, bounds[name][0]), bounds[name][1])
    for name in COLOURED & set(params):
        params[name] = list(DIFFUSE)
    return params


def _in_plane(model: Model, params: Params, theta_i: float, theta_o: Array) -> Array:
    """Luminance of f [N] for signed angles in radians, positive on the mirror's side."""
    phi_o = np.where(theta_o >= 0.0, math.pi, 0.0)
    f = evaluate(model, params, theta_i, 0.0, np.abs(theta_o), phi_o)
    return _luminance(f)


def _luminance(f: Array) -> Array:
    return f[0] if len(f) == 1 else LUMINANCE @ f


def _returns_light(model: Model, params: Params) -> bool:
    """Whether the lobe of 45 degrees stands at the incidence rather than at the mirror."""
    theta_i = math.radians(45.0)
    back, side, mirror = _in_plane(model, params, theta_i, np.array([-theta_i, 0.0, theta_i]))
    return bool(back > 5.0 * max(side, mirror))


def _sphere(model: Model, params: Params) -> NDArray[np.uint8]:
    """Render the sphere, shape (DIAMETER, DIAMETER, 3), sRGB on the background."""
    size = DIAMETER * SUPERSAMPLING
    axis = (np.arange(size) + 0.5) * (2.0 / size) - 1.0
    x, y = np.meshgrid(axis, -axis)
    inside = x * x + y * y < 1.0
    n_x, n_y = x[inside], y[inside]
    normal = np.stack([n_x, n_y, np.sqrt(1.0 - n_x**2 - n_y**2)])
    across = np.stack([normal[2], np.zeros_like(n_x), -n_x]) / np.hypot(normal[2], n_x)
    frame = np.stack([across, np.cross(normal, across, axis=0), normal])

    def angles(towards: tuple[float, float, float]) -> tuple[Array, Array]:
        local = np.einsum("kcn,c->kn", frame, np.array(towards) / np.linalg.norm(towards))
        theta = np.arctan2(np.hypot(local[0], local[1]), local[2])
        return theta, np.arctan2(local[1], local[0])

    radiance = np.zeros((3, n_x.size))
    theta_o, phi_o = angles((0.0, 0.0, 1.0))
    for lamp in ("key", "camera" if _returns_light(model, params) else "rim"):
        theta_i, phi_i = angles(LIGHTS[lamp])
        f = evaluate(model, params, theta_i, phi_i, theta_o, phi_o)
        radiance += f * (POWER[lamp] * np.maximum(np.cos(theta_i), 0.0))
    radiance *= (1.0 + radiance / WHITE**2) / (1.0 + radiance)
    image = np.empty((size, size, 3))
    image[:] = _linear(np.array([int(BACKGROUND[k : k + 2], 16) / 255 for k in (1, 3, 5)]))
    image[inside] = np.clip(radiance, 0.0, 1.0).T
    shape = (DIAMETER, SUPERSAMPLING, DIAMETER, SUPERSAMPLING, 3)
    image = image.reshape(shape).mean(axis=(1, 3))
    curve = np.where(image <= 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)
    rendered: NDArray[np.uint8] = np.round(255.0 * curve).astype(np.uint8)
    return rendered


def _linear(srgb: Array) -> Array:
    result: Array = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return result


def _lobes(axes: Axes, model: Model, params: Params) -> None:
    """Draw f over theta_o: on a logarithmic scale where it spans more than a decade."""
    theta_o = np.radians(np.linspace(-89.5, 89.5, 7161))
    curves = [_in_plane(model, params, math.radians(t), theta_o) for t in INCIDENCES]
    # Ever thinner, so that curves that coincide are all seen.
    for t, f, colour, width in zip(INCIDENCES, curves, COLOURS, (2.8, 1.9, 1.0), strict=True):
        axes.plot(np.degrees(theta_o), f, color=colour, lw=width, label=f"theta_i {t}°")
        axes.axvline(t, color=colour, lw=0.8, ls=":", alpha=0.7, zorder=0)
    inner = np.stack(curves)[:, np.abs(theta_o) < math.radians(80.0)]
    top = float(inner.max())
    if top > 10.0 * float(np.median(inner)):
        axes.set_yscale("log")
        highest = max(3.0, math.ceil(math.log10(1.2 * top)))
        axes.set_ylim(1e-3, 10.0**highest)
        axes.set_yticks(10.0 ** np.arange(-3, highest + 1))
        axes.minorticks_off()
    else:
        axes.set_ylim(0.0, max(0.1, math.ceil(11.0 * top) / 10.0))
    axes.set_xlim(-90, 90)
    axes.set_xticks(range(-90, 91, 30))
    axes.set_xlabel("theta_o in the plane of incidence [°], positive on the mirror side")
    axes.set_title("f [1/sr]", fontsize=9, color=INK, loc="left", pad=5)
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        borderaxespad=0.0,
        ncols=len(INCIDENCES),
        columnspacing=1.2,
        handlelength=1.4,
        frameon=False,
        fontsize=9,
        labelcolor=INK,
    )
    axes.grid(color=FAINT, lw=0.5)
    axes.set_facecolor(BACKGROUND)
    axes.tick_params(colors=INK, labelsize=8, length=3)
    axes.xaxis.label.set(color=INK, fontsize=8.5)
    for side, spine in axes.spines.items():
        spine.set(color=FAINT, visible=side in ("left", "bottom"))


def _values_text(params: Params) -> str:
    """List the parameters that are not 0; some models have a dozen."""
    parts = []
    for name, value in params.items():
        values = value if isinstance(value, list) else [value]
        if not any(values):
            continue
        parts.append(f"{name} " + "\N{THIN SPACE}/\N{THIN SPACE}".join(f"{v:g}" for v in values))
    # A name stays with its value.
    text = ",  ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in parts)
    return "\n".join(textwrap.wrap(text, 58, break_long_words=False, break_on_hyphens=False))


def _colours(image: Image.Image, count: int) -> list[int]:
    """Give so many colours of an image's palette, the last one repeated where it has fewer."""
    used = (image.getpalette() or [])[: 3 * count]
    return used + used[-3:] * (count - len(used) // 3)


def draw(model: Model, path: Path) -> None:
    """Draw a model and write the picture as a PNG with a palette.

    Parameters
    ----------
    model : Model
        Any model.
    path : Path
        The PNG.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    params = shown_parameters(model)
    figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor=BACKGROUND)
    FigureCanvasAgg(figure)
    figure.text(MARGIN / WIDTH, 1 - 10 / HEIGHT, model.name, color=INK, size=11, va="top")
    bottom = HEIGHT - TOP - DIAMETER
    figure.figimage(_sphere(model, params)[::-1], MARGIN, bottom, origin="lower")
    figure.text(
        (MARGIN + DIAMETER / 2) / WIDTH,
        (bottom - 8) / HEIGHT,
        _values_text(params),
        color=INK,
        size=8,
        va="top",
        ha="center",
        linespacing=1.3,
    )
    _lobes(figure.add_axes(PLOT), model, params)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, facecolor=BACKGROUND)
    picture = Image.open(buffer).convert("RGB")
    # Colours for the sphere by their share of it, for the plot by their difference: lines are
    # few pixels. Without dithering smooth shades stay runs of equal bytes, which compress.
    edge = int(PLOT[0] * WIDTH) - 60
    sphere = picture.crop((0, 0, edge, HEIGHT)).quantize(
        SPHERE_COLOURS, Image.Quantize.MEDIANCUT, kmeans=2
    )
    plot = picture.crop((edge, 0, WIDTH, HEIGHT)).quantize(
        256 - SPHERE_COLOURS, Image.Quantize.MAXCOVERAGE
    )
    palette = Image.new("P", (1, 1))
    palette.putpalette(_colours(sphere, SPHERE_COLOURS) + _colours(plot, 256 - SPHERE_COLOURS))
    picture.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)
