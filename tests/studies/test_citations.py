"""Citations: each lobe has some, its manual page names the same authors, and methods follow what was done."""

import copy
import inspect
import re
from typing import Any

from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.registry import LOBES
from fitmat.studies.citations import SHAPES, TERMS, _entries, bibtex, of_model


def record(**changes: Any) -> dict[str, Any]:
    posterior = {"verdict": "reliable", "pareto_k": 0.2, "second_sampler": None}
    fit = {
        "model": "lambert+ggx-schlick",
        "posterior": posterior,
        "budget": None,
        "identifiability": None,
        "predictive_check": None,
        "readings": {"fitted": 10, "independent": 10.0},
    }
    plain = {"fitmat": "0.1.0", "fits": [fit], "match": None, "choice": None, "next": None}
    return copy.deepcopy(plain | changes)


def author(key: str) -> str:
    """Family name of the first."""
    found = re.search(r"author = \{+(.+?)\}?,\n", _entries()[key])
    assert found is not None
    return found[1].split(" and ")[0].split(",")[0].replace('{\\"o}', "ö")


def test_every_lobe_is_cited_as_its_manual_page_says() -> None:
    """The first author stands on the page of the lobe, beside its term, or on that of the lobe it adds to."""
    for name, lobe in LOBES.items():
        page = f"{lobe.shape.__doc__} {Microfacet.__doc__ if '-kc' in name or '-turquin' in name else ''}"
        keys = of_model(f"{name}-over-eon" if lobe.kind == "cover" else name)
        terms = {key for term, found in TERMS.items() if term in name for key in found}
        assert keys
        for key in set(keys) - terms - ({"portsmouth2025"} if lobe.kind == "cover" else set()):
            assert author(key) in page, (name, key)
        if terms:
            rooms = [inspect.getmodule(part) for part in (lobe.shape, *lobe.parts.values())]
            text = " ".join(inspect.getsource(room) for room in rooms if room is not None)
            assert all(author(key) in text for key in terms), (name, terms)


def test_every_entry_is_used_and_is_bibtex() -> None:
    """Balanced braces, a key, an author, a title and a year; no key that nothing leads to."""
    entries = _entries()
    for key, text in entries.items():
        assert text.count("{") == text.count("}"), key
        assert re.match(rf"@[a-z]+\{{{key},\n  author = \{{.+\}},\n  title = \{{.+\}},\n", text)
        year = re.search(r"year = \{(\d{4})\}", text)
        assert year is not None
        assert key.endswith(year[1])
    named = {key for keys in (*SHAPES.values(), *TERMS.values()) for key in keys}
    assert named <= entries.keys()


def test_methods_are_cited_where_they_were_used() -> None:
    plain = bibtex(record())
    assert plain.startswith("@software{fitmat,\n  title = {fitmat},\n  version = {0.1.0}}\n@book{lambert1760,")
    assert "schlick1994" in plain
    assert "vehtari2024" in plain
    for key in (
        "foremanmackey2013",
        "hoffman2014",
        "sharma2005",
        "chandler2007",
        "chaloner1995",
        "gum2008",
        "raue2009",
    ):
        assert key not in plain
    fit = record()["fits"][0]
    fit |= {"budget": {"words": ""}, "identifiability": {"words": ""}, "predictive_check": {"failed": False}}
    fit |= {"readings": {"fitted": 10, "independent": 4.0}}
    fit["posterior"] |= {"steps": 100, "second_sampler": {"verdict": "agree"}}
    full = bibtex(
        record(
            fits=[fit],
            match={"perceived": {"words": ""}},
            choice={"candidates": [{"elpd": 1.0}]},
            next={"against": "lambert+blinn-phong"},
        )
    )
    for key in ("foremanmackey2013", "hoffman2014", "sharma2005", "chandler2007", "box1967", "gum2008", "vehtari2017"):
        assert full.count(f"{{{key},") == 1
    assert full.count("@") == len(set(re.findall(r"@\w+\{(\w+),", full)))
