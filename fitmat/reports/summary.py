"""Summary: the page of a batch, a line for each file with its best model, sorted and cut down in the browser.

It computes nothing: its rows are those of the table.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from fitmat.reports.rendering import POLICY, digest, environment, static
from fitmat.text import visible_in

SCRIPT, STYLES = "summary.js", ("page.css", "summary.css")


def to_html(
    files: Sequence[Mapping[str, Any]], refused: Sequence[Mapping[str, Any]], pooled: Sequence[str] = ()
) -> str:
    """The page.

    Args:
        files: Of each file that was fitted: its name, swatch, the sentences and levels of its three cards, and the
            numbers delta_e, distance and misfit, None where there is none.
        refused: Of each that was not: its message.
        pooled: What the files tell together, in sentences.
    """
    script = static(SCRIPT)
    return (
        environment()
        .get_template("batch.html")
        .render(
            files=visible_in(list(files)),
            refused=visible_in(list(refused)),
            pooled=visible_in(list(pooled)),
            count=len(files) + len(refused),
            policy=POLICY.format(f"'sha256-{digest(script)}'"),
            script=Markup(script),
            styles=[Markup(static(name)) for name in STYLES],
        )
    )
