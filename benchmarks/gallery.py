"""Remakes the pictures of `docs/gallery`, and their table in `docs/gallery.md`: every kind of model on a ball.

Run: python benchmarks/gallery.py
"""

import re
from pathlib import Path

import jax

import fitmat as fm
from fitmat.cli.simulate import truth
from fitmat.files import write_text

PAGE = Path(__file__).parents[1] / "docs" / "gallery.md"
FOLDER = PAGE.with_suffix("")

SIZE, EXPOSURE, ACROSS = 160, 0.4, 4
"""Pixels along a side, factor from radiance to display, pictures in a row."""

GOLD = "eta=0.18,0.42,1.37 kappa=3.42,2.35,1.77"
ALUMINIUM = "eta=1.35,0.96,0.61 kappa=7.47,6.4,5.3"
MATERIALS = {
    "plaster": ("oren-nayar", "kd=0.75,0.72,0.66 sigma_n=30"),
    "terracotta": ("eon", "kd=0.62,0.28,0.16"),
    "Phong, as of 1975": ("lambert+phong", "kd=0.05,0.2,0.4 ks=0.3 exponent=40"),
    "satin paint": ("lambert+ggx", "kd=0.45,0.06,0.04 alpha=0.2 eta=1.5"),
    "glossy plastic": ("plastic", "kd=0.02,0.32,0.25 alpha=0.06 eta=1.5"),
    "gold": ("ggx-conductor", f"alpha=0.2 {GOLD}"),
    "brushed aluminium": ("ggx-aniso-conductor", f"alpha_x=0.08 alpha_y=0.35 {ALUMINIUM}"),
    "rough gold, all light kept": ("ggx-kc-conductor", f"alpha=0.7 {GOLD}"),
    "blasted steel": ("beckmann-conductor", "alpha=0.45 eta=2.9 kappa=3.1"),
    "varnished wood": ("rough-varnish-over-oren-nayar", "kd=0.5,0.26,0.1 sigma_n=20 alpha=0.05 depth=0.05,0.1,0.3"),
    "velvet": ("disney-2012", "base_color=0.25,0.02,0.12 roughness=0.9 sheen=1 sheen_tint=0.6"),
    "car paint": ("disney-2015", "base_color=0.02,0.06,0.35 metallic=0.7 roughness=0.4 clearcoat=1"),
}
"""Name → model and parameters, as of `fitmat render`."""


def main() -> None:
    """Writes the pictures and the table."""
    jax.config.update("jax_enable_x64", True)
    cells, commands, total = [], [], 0
    for name, (model, settings) in MATERIALS.items():
        file = FOLDER / f"{re.sub('[^a-z0-9]+', '-', name.lower())}.png"
        picture = fm.render(truth(model, settings.split(), None), size=SIZE, exposure=EXPOSURE)
        total += picture.save(file)[0].stat().st_size
        commands.append(" ".join(["fitmat render", model, *(f"--set {each}" for each in settings.split())]))
        cells.append(f'<img src="gallery/{file.name}" alt="Ball of {name}" width="{SIZE}"><br>{name}<br>`{model}`')
        print(f"{file}: {picture}")
    rows = [cells[k : k + ACROSS] for k in range(0, len(cells), ACROSS)]
    first, *more = (f"| {' | '.join(row)} |" for row in rows)
    table = "\n".join([first, "|" + " :---: |" * ACROSS, *more])
    text = PAGE.read_text(encoding="utf-8")
    lines = "\n".join(commands)
    for mark, new in (("gallery", table), ("commands", f"```sh\n{lines}\n```")):
        before, rest = text.split(f"<!-- {mark} -->\n")
        text = f"{before}<!-- {mark} -->\n{new}\n<!-- /{mark} -->{rest.split(f'<!-- /{mark} -->')[1]}"
    write_text(PAGE, text)
    print(f"{len(MATERIALS)} pictures, {total} bytes.")


if __name__ == "__main__":
    main()
