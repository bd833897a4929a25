"""What `fitmat models` prints: the list of lobes, the page of each, the table of laws, and that of Fresnel terms.

The pages are the docstrings; nothing is computed here.
"""

import inspect
import itertools
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import equinox as eqx
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from rich.text import Text

from fitmat.fitting.losses import LOSSES
from fitmat.maths import programs
from fitmat.models import laws
from fitmat.models.estimated import Walked
from fitmat.models.registry import LOBES, OVER, WALKS, Lobe, lobe_names, model

FRESNEL, TRANSMISSION, HEITZ = "fresnel", "transmission", "heitz"
"""Pages of no lobe: the Fresnel terms compared, what a dielectric interface lets through, and multiple scattering."""

GLASS = 1.5
"""Index of the interfaces on that page."""


def list_models() -> None:
    """Print every lobe with the Fresnel terms it can carry and the first line of its manual page."""
    table = _table("lobe", "or with", "what it is")
    for name, variants in _families().items():
        table.add_row(name, Text(" ".join(variants)), Text(_first_line(LOBES[name].shape)))
    out = Console()
    out.print(table)
    out.print(
        "\nA model is a sum of lobes, lambert+ggx or lambert+ggx-schlick, alone or below a cover: "
        "varnish-over-lambert+ggx.\n'fitmat models ggx' prints the manual page of a lobe, 'fitmat models fresnel' how "
        "exact the Fresnel terms are, 'fitmat models transmission' what a dielectric interface lets through, "
        "'fitmat models heitz' multiple scattering without approximation, 'fitmat models --check' which laws the lobes "
        "keep.",
        highlight=False,
    )


def list_losses() -> None:
    """Print every loss with its formula, whether it supports a posterior, and where it comes from."""
    table = _table("loss", "residual", "posterior", "what it is good for", "source")
    for known in LOSSES.values():
        table.add_row(
            *(Text(cell) for cell in (known.name, known.formula, "yes" if known.posterior else "no")),
            Text(known.doc),
            Text(known.source),
        )
    out = Console()
    out.print(table)
    out.print(
        "\ny measured, f model, c_i = cosθ_i. A loss with a posterior is the logarithm of a probability density; the "
        "others reproduce published fits and give no intervals. 'fitmat fit FILE --loss NAME' uses one.",
        highlight=False,
    )


def _families() -> dict[str, list[str]]:
    """Lobes with the exact dielectric, or none, and the suffixes of the other Fresnel terms they exist with."""
    found: dict[str, list[str]] = {}
    for name, lobe in LOBES.items():
        suffix = lobe.fresnel_suffix(name)
        found.setdefault(name.removesuffix(suffix), []).extend([suffix] if suffix else [])
    return found


def _table(*headings: str) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in headings:
        table.add_column(heading, no_wrap=heading == "lobe")
    return table


def _first_line(documented: object) -> str:
    return (inspect.getdoc(documented) or "").split("\n", 1)[0]


def page(name: str) -> None:
    """Print the manual page of a lobe, or of every lobe of a model, and its parameters.

    Raises:
        ModelError: no such lobe.
    """
    if name in (FRESNEL, TRANSMISSION):
        {FRESNEL: fresnel_terms, TRANSMISSION: transmission}[name]()
        return
    if name == HEITZ or name in WALKS:
        walked(name)
        return
    out = Console()
    for part in _parts(name):
        lobe = LOBES[part]
        out.print(f"[bold]{part}[/bold]\n")
        _prose(out, lobe.shape.__doc__)
        for law, words in lobe.breaks.items():
            out.print(f"Breaks the law '{law}' ({laws.LAWS[law]}): {words}.\n", markup=False, highlight=False)
        _parameters(out, lobe)


def walked(name: str) -> None:
    """Print the page of multiple scattering, with the parameters of one of `WALKS`, or the names of all."""
    out = Console()
    out.print(f"[bold]{name}[/bold]\n")
    _prose(out, Walked.__doc__)
    if name in WALKS:
        _parameters(out, LOBES[WALKS[name][0]])
    else:
        out.print(f"Names: {', '.join(WALKS)}.", markup=False, highlight=False)


def _parameters(out: Console, lobe: Lobe) -> None:
    """The table of a lobe's parameters."""
    table = _table("parameter", "symbol", "range", "unit", "default", "channels", "meaning")
    for key, (p, default) in lobe.defaults().items():
        spread = "one each" if lobe.per_channel(key) else "shared"
        unit = "" if p.unit == "1" else p.unit
        table.add_row(key, p.symbol, f"{p.lower:g} – {p.upper:g}", unit, f"{default:g}", spread, p.doc)
    out.print(table)


def _prose(out: Console, text: str | None) -> None:
    """The paragraphs of a docstring."""
    for paragraph in inspect.cleandoc(text or "").split("\n\n"):
        out.print(" ".join(paragraph.split()) + "\n", markup=False, highlight=False)


def _parts(name: str) -> list[str]:
    return [name] if name in LOBES else lobe_names(name)


def within(name: str | None) -> Callable[[str], bool]:
    """Which lobes a name means: those of a model, or all where there is none.

    Raises:
        ModelError: no such lobe.
    """
    parts = LOBES.keys() if name is None else _parts(name)
    return lambda lobe: lobe in parts


def check(*, seed: int = 0, only: Callable[[str], bool] = lambda name: True) -> list[str]:
    """Measure and print which laws every lobe keeps, with a progress bar on stderr.

    Args:
        seed: Of the directions and parameters tried.
        only: Which lobes.

    Returns:
        The models that break a law which their pages do not declare.
    """
    table = _table("model", *laws.LAWS)
    names = [example for name in LOBES if only(name) for example in laws.examples(name)]
    alike: dict[str, list[str]] = {}
    for name in names:
        lobe = name.rpartition(OVER)[2]
        alike.setdefault(name.removesuffix(LOBES[lobe].fresnel_suffix(lobe)), []).append(name)
    # Covers first, which take longest. Lobes that differ in their Fresnel term alone are the same white one.
    groups = sorted(alike.values(), key=lambda group: OVER not in group[0])
    with ProcessPoolExecutor(min(len(groups), os.cpu_count() or 1), get_context("spawn")) as pool:
        # most of it is tracing, one thread at a time
        checked = pool.map(_measured, groups, itertools.repeat(seed))
        progress = track(checked, "checking", len(groups), console=Console(stderr=True), transient=True)
        found_of = {name: found for some in progress for name, found in some.items()}
    measured = [(name, found_of[name]) for name in names]
    broken: dict[bool, list[str]] = {True: [], False: []}
    for name, found in measured:
        declared = _exceptions(name)
        table.add_row(name, *(_verdict(law, finding, law in declared) for law, finding in found.items()))
        for law in (law for law, finding in found.items() if not finding.holds):
            broken[law in declared].append(f"{name} ({law})")
    out = Console()
    out.print(table)
    for law, words in laws.LAWS.items():
        out.print(f"{law}: {words}", highlight=False)
    for told, which in ((True, "as their manual pages say"), (False, "unexpectedly")):
        out.print(f"Broken {which}: {len(broken[told])}. {', '.join(broken[told])}", highlight=False, soft_wrap=True)
    return list(dict.fromkeys(name.rpartition(" ")[0] for name in broken[False]))


def _exceptions(name: str) -> set[str]:
    """The laws that a model may break: what its lobes declare, and the furnace where facets lose light."""
    parts = lobe_names(name)
    lost = set() if laws.keeps_all(parts[0]) else {"furnace"}
    return lost.union(*(LOBES[part].breaks for part in parts))


def _measured(group: list[str], seed: int) -> dict[str, dict[str, laws.Finding]]:
    """The laws of models that may be the same white one, in a process that holds no more than one model's programs."""
    import jax

    jax.config.update("jax_enable_x64", True)
    found: dict[str, dict[str, laws.Finding]] = {}
    for name in group:
        alike = found and eqx.tree_equal(laws.white(model(name)), laws.white(model(group[0])))
        with programs.hasty():
            found[name] = laws.check(model(name), seed=seed, furnace=found[group[0]]["furnace"] if alike else None)
        programs.clear()
    return found


def _verdict(law: str, finding: laws.Finding, declared: bool) -> Text:
    number = {
        "positive": f"{finding.number:.2g}",
        "reciprocal": f"{finding.number:.0e}",
        "energy": f"{finding.number:.3f}",
        "gradient": f"{finding.number:.0f} bad",
        "furnace": f"{finding.number:.3f}",
    }[law]
    if finding.holds:
        return Text("holds" if law in ("positive", "gradient") else f"holds {number}")
    return Text(f"broken {number}", style="yellow" if declared else "red")


def fresnel_terms() -> None:
    """Print how far Schlick's, Hoffman's and Belcour's Fresnel terms are from the exact equations."""
    from fitmat.models.terms.belcour import error_table

    errors: dict[str, list[str]] = {}
    names: list[str] = []
    for row in error_table():
        errors.setdefault(row.material, []).extend([f"{row.worst:.4f}", f"{row.mean:.4f}"])
        names += [row.approximation] if row.approximation not in names else []
    table = _table("material", *(f"{name} {what}" for name in names for what in ("worst", "mean")))
    for material, numbers in errors.items():
        table.add_row(material, *numbers)
    out = Console()
    out.print("[bold]Fresnel terms against the exact equations[/bold]\n")
    out.print(table)
    out.print("\nAbsolute errors of the reflectance over 0–90° and 400–700 nm.", highlight=False)
    for suffix in dict.fromkeys(suffix for variants in _families().values() for suffix in variants):
        term = next(lobe.parts["fresnel"] for name, lobe in LOBES.items() if name == "ggx" + suffix)
        out.print(f"{suffix}: {_first_line(term)}", markup=False, highlight=False)


def transmission() -> None:
    """Print the page of dielectric interfaces, and what one collision reflects and transmits, from either side."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from fitmat.models import interface

    out, angles = Console(), (0.0, 30.0, 60.0, 80.0)
    out.print("[bold]transmission[/bold]\n")
    _prose(out, interface.__doc__)
    table = _table("GGX, eta 1.5", *(f"{angle:g}°" for angle in angles))
    for inside, side in ((False, "from above"), (True, "from below")):
        smooth = interface.transmittance(np.deg2rad(angles), 1.0 / GLASS if inside else GLASS)
        table.add_row(f"smooth, {side}: R + T", *(f"{1.0 - t:.3f} + {t:.3f}" for t in smooth))
        for alpha in (0.1, 0.3, 1.0):
            rough = interface.Surface("ggx", alpha, GLASS, transmits=True)
            found = interface.albedo_interface(rough, np.deg2rad(angles), inside=inside)
            shares = zip(found.reflected, found.transmitted, strict=True)
            table.add_row(f"alpha {alpha:g}, {side}", *(f"{r:.3f} + {t:.3f}" for r, t in shares))
    out.print(table)
    out.print("\nWhat is missing from 1 meets the interface again: fitmat.albedo_walk follows it.", highlight=False)
