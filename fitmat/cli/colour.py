"""Colour: what a material or a run's models look like, and what RGB makes of Fresnel, as the command line shows it.

It computes nothing itself.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat.cli import session
from fitmat.colour import observers
from fitmat.colour.spaces import FROM_SRGB, linear, to_srgb
from fitmat.errors import FitmatError, ModelError
from fitmat.models.in_rgb import WAYS, InRgb, fresnel_in_rgb, published
from fitmat.models.refractive_index import MATERIALS, describe
from fitmat.models.spectral import absorbs
from fitmat.text import visible

if TYPE_CHECKING:
    from fitmat.studies.energies import Energy
    from fitmat.studies.result import Fitted

TABLES = ("metals", "dielectrics")
AT = (0, 30, 60, 80)
"""Degrees of the columns."""

SPACES = {"srgb": "linear sRGB", "p3": "linear Display P3", "acescg": "ACEScg"}


def show(
    material: str | None, table: str | None, illuminant: str, plot: Path | None, *, force: bool, energy: bool = False
) -> None:
    """Print what was asked for: one material, with its picture, a table of all, or the models of a run.

    Raises:
        FitmatError: neither or both were asked for, something is not known, or the picture cannot be written.
    """
    if energy and (material is None or not Path(material).exists()):
        raise ModelError("--energy without a run, expected its folder: fitmat colour RUN --energy.")
    if table is not None and (material, plot, illuminant) != (None, None, "D65"):
        raise ModelError("--table beside a material, --plot or --illuminant, expected it alone. Leave one out.")
    if table is not None:
        list_all(table)
    elif material is None:
        raise ModelError("expected a material or --table: fitmat colour Au, or fitmat colour --table metals.")
    elif Path(material).exists():
        if energy and plot is not None:
            raise ModelError("--plot beside --energy, of which there is no picture. Leave one out.")
        if energy:
            energies(material, illuminant)
        else:
            run(material, illuminant, plot, force=force)
    elif plot is None:
        page(fresnel_in_rgb(material, illuminant))
    else:
        from fitmat.reports import colour_plot, pictures

        pictures.refuse_picture(plot, force=force)
        found = fresnel_in_rgb(material, illuminant)
        pictures.write_picture(lambda: colour_plot.fresnel(found), plot)
        page(found)


def page(found: InRgb) -> None:
    """Print the sentence, the colours and the errors of one material."""
    reflected = Table("reflected, not clipped", "red", "green", "blue", box=None, pad_edge=False)
    for name, values in (("F0", found.f0), ("F82", found.f82)):
        for space, words in SPACES.items():
            reflected.add_row(f"{name}, {words}", *_three(linear(values @ FROM_SRGB.T, space)))
    reflected.add_row("edge tint, F82 over Schlick's", *_three(found.tint))
    reflected.add_row("η, exact with one a channel", *_three(np.real(found.indices)))
    reflected.add_row("κ", *_three(np.imag(found.indices)))
    errors = Table("", *(f"{angle}°" for angle in AT), "most", "diffuse", box=None, pad_edge=False)
    for way in WAYS:
        at = [f"{found.delta_e_2000[way][angle]:.2f}" for angle in AT]
        most, angle = found.worst(way)
        errors.add_row(way, *at, f"{most:.2f} at {angle:.0f}°", f"{found.diffuse[way]:.2f}")
    clipped = " (clipped)" if max(found.f0.max(), found.f82.max()) > 1.0 else ""
    light = observers.ILLUMINANTS[found.illuminant]
    out = Console()
    _say(out, f"{visible(found.material)}: {visible(describe(found.material))}\n\n{found.sentence}\n")
    out.print(reflected)
    _say(out, f"On a display: {_hex(found.f0)} at 0°, {_hex(found.f82)} at 82°{clipped}.\n")
    _say(out, f"ΔE2000 from the spectrum, under {light}; diffuse: lit from everywhere.")
    out.print(errors)
    _say(out, "\n" + "\n".join(f"{way}: {words}." for way, words in WAYS.items()))


def run(folder: str, illuminant: str, plot: Path | None = None, *, force: bool = False) -> None:
    """Print the colour of every model of a run, away from the highlight, and how sure it is; draw them where asked.

    Raises:
        FitmatError: it is no run, its channels have no colour under that light, or the picture cannot be written.
    """
    with session.computing() as watch:
        from fitmat.studies.colours import colour_of
        from fitmat.studies.result import load

        found = []
        for one in load(folder).fits:
            watch(f"finding the colour of {one.name}", 0, 0)
            found.append(colour_of(one, illuminant=illuminant))
    out = Console()
    if plot is not None:
        from fitmat.reports import colour_plot, pictures

        pictures.refuse_picture(plot, force=force)
        if found[0].grey:
            raise ModelError(f"--plot of {visible(folder)}: one channel has no a* and b* to draw. Leave it out.")
        pictures.write_picture(lambda: colour_plot.colours(found), plot)
    for one in found:
        _say(out, f"{visible(one.sentence)} On a display: {one.srgb}.\n")
    _say(out, "Light from 45°, seen along the normal; CIE 1931 2° observer; the white diffuser is white.")


def energies(folder: str, illuminant: str) -> None:
    """Print what renderers lose of the highlight of every model of a run that has one, by roughness and angle.

    Raises:
        FitmatError: it is no run, or its channels have no colour under that light.
    """
    with session.computing() as watch:
        from fitmat.studies.energies import WAYS
        from fitmat.studies.result import load

        each = [(one, _lost(one, illuminant, watch)) for one in load(folder).fits]
    out = Console()
    for one, lost in each:
        if not lost:
            _say(out, f"{visible(one.name)}: no single isotropic lobe of facets.\n")
            continue
        own = lost[0]
        table = Table("alpha", "", *(f"{angle:.0f}°" for angle in np.rad2deg(own.theta)), box=None, pad_edge=False)
        for found in lost:
            for way, apart in found.delta_e_2000.items():
                table.add_row(
                    f"{found.alpha:.3g}{' (fitted)' if found is own else ''}",
                    WAYS[way],
                    *(f"{value:.1f}" for value in apart),
                )
        _say(out, f"{visible(own.sentence)}\n")
        out.print(table)
    if any(lost for _, lost in each):
        _say(out, "\nΔE2000 from Heitz's random walk by angle of view, under light from everywhere.")


def _lost(fitted: "Fitted", illuminant: str, watch: session.Watch) -> list["Energy"]:
    """What is lost at the fitted roughness, then at those of a table; empty where there is no single highlight."""
    from fitmat.studies.energies import ALPHAS, energy_of, highlights

    if len(highlights(fitted)) != 1:
        return []
    stage, count = f"walking among the facets of {fitted.name}", 1 + len(ALPHAS)
    watch(stage, 0, count)
    found = [energy_of(fitted, illuminant=illuminant)]
    for alpha in ALPHAS:
        watch(stage, len(found), count)
        if f"{alpha:.3g}" != f"{found[0].alpha:.3g}":
            found.append(energy_of(fitted, alpha=alpha, illuminant=illuminant))
    return found


def list_all(kind: str) -> None:
    """Print F0 and edge tint of all metals or dielectrics, and how far apart datasets are where the database is.

    Raises:
        ModelError: no such table.
    """
    if kind not in TABLES:
        raise ModelError(f"--table {visible(kind)}: expected {' or '.join(TABLES)}.")
    metals = kind == "metals"
    heads = ("", "F0, linear sRGB", "sRGB", "edge tint", *(["furthest data"] if metals else []))
    table, missing = Table(*heads, box=None, pad_edge=False), None
    for name in MATERIALS:
        if absorbs(name) != metals:
            continue
        found, cells = fresnel_in_rgb(name), []
        try:
            cells = [_furthest(name)] if metals else []
        except FitmatError as error:
            missing = error
        table.add_row(name, " ".join(_three(found.f0)), _hex(found.f0), " ".join(_three(found.tint)), *cells)
    out = Console()
    out.print(table)
    _say(
        out,
        "\nF0 under D65 (CIE 1931 2° observer), not clipped; as a display shows it; F82 over Schlick's curve there.",
    )
    if missing is not None:
        _say(out, str(missing))
    elif metals:
        _say(out, "Furthest data: ΔE2000 to F0 of that dataset of refractiveindex.info, of so many.")


def _furthest(name: str) -> str:
    """How far F0 of the furthest dataset looks, whose it is, and of how many."""
    known = published(name)
    return f"{known.delta_e_2000:.1f} {known.furthest.rpartition('/')[2]} ({known.datasets})"


def _say(out: Console, text: str) -> None:
    out.print(Text(text))


def _three(values: np.ndarray) -> list[str]:
    return [f"{value:.3f}" for value in values]


def _hex(rgb: np.ndarray) -> str:
    return "#" + "".join(f"{round(255 * float(x)):02x}" for x in to_srgb(rgb @ FROM_SRGB.T))
