"""The report of a run: page, JSON object and pictures, complete, strict, self-contained, safe whatever the names are.

Of pictures what was drawn counts: numbers of points and lines, labels, limits; never pixels.
"""

import base64
import dataclasses
import hashlib
import html
import html.parser
import json
import math
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import fitmat
from fitmat.errors import FitmatError, OutputError, ReadError
from fitmat.measurements.samples import Measurements
from fitmat.models.simulation import simulate
from fitmat.reports import page, rendering
from fitmat.reports.page import figured
from fitmat.reports.rows import parameter_rows
from fitmat.studies import record
from fitmat.studies.cards import cards
from fitmat.studies.citations import bibtex
from fitmat.studies.findings import find
from fitmat.studies.study import Study, study
from fitmat.text import interval, plain, with_error
from fitmat.uncertainty.posterior import Posterior

NAMES = ["lambert+blinn-phong", "lambert+ggx"]


def paint() -> Measurements:
    """Three channels, three incidences, 17 directions each; the first row of green is masked."""
    truth = fitmat.model("lambert+ggx", channels=3, kd=np.array([0.4, 0.1, 0.2]), alpha=0.3)
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    made = simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    valid = made.valid.copy()
    valid[0, 1] = False
    return dataclasses.replace(made, source="paint.csv", valid=valid)


@pytest.fixture(scope="module")
def studied() -> Study:
    return study(paint(), NAMES, sampling=False, full=True)


def alone(posterior: Posterior) -> Study:
    """A study of one model, without sections."""
    return Study((find(posterior, ()),))


def html_of(found: Study) -> str:
    return rendering.to_html(record.to_dict(found), figured(found))


@pytest.fixture(scope="module")
def report(studied: Study) -> str:
    return html_of(studied)


VOID = ("meta", "img", "br")
"""Tags that enclose nothing."""


class Page(html.parser.HTMLParser):
    """Tags that are open, every attribute that links somewhere, and the text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.words: list[str] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Remember the tag and where it links."""
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "action")]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Remember a tag that encloses nothing."""
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Close the innermost tag, which must be this one."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Remember the text, but no script's."""
        if self.open[-1:] not in (["script"], ["style"]):
            self.words.append(data)

    @property
    def text(self) -> str:
        """All text, single-spaced."""
        return " ".join(" ".join(self.words).split())


def test_page_is_well_formed_and_says_what_was_found(report, studied):
    read = Page(report)
    assert read.open == []
    assert studied.match is not None
    assert studied.match.verdict in read.text.replace("\u00a0", " ")
    for card in cards(record.to_dict(studied)):
        assert card.after_word in read.text.replace("\u00a0", " ")
    for entry in bibtex(record.to_dict(studied)).split("\n@"):
        assert " ".join(entry.split()).removeprefix("@") in read.text
    for words in (
        *NAMES,
        "51 samples, 3 channels",
        "kd g",
        "→ f0",
        "95 % interval",
        f"{studied.posteriors[1].fit.bic:.1f}",
    ):
        assert words in read.text
    assert not re.search(r"\bnan\b", read.text.lower())


def test_a_page_without_scripts_has_words_tables_and_curves(report, studied):
    """What a reader without JavaScript sees: the still picture has every point of the middle channel, both fits."""
    read = Page(report)
    still = report[report.index('id="static-curves"') :].partition("</svg>")[0]
    assert still.count("<circle") == int(studied.measurements.valid[:, 1].sum())
    assert still.count("<polyline") == 3 * len(NAMES)
    assert read.tags.count("table") >= 8
    assert [read.tags.count(tag) for tag in ("main", "h1")] == [1, 1]


def test_pictures_are_embedded_and_whole(report, studied):
    """Swatches of both models, the best one twice, and both spheres and their difference in each light."""
    links = Page(report).links
    assert studied.match is not None
    assert len(links) == 3 + 3 * len(studied.match.perceived.lightings)
    for link in links:
        kind, _, data = link.partition(",")
        assert kind == "data:image/png;base64"
        image = base64.b64decode(data, validate=True)
        width, height = struct.unpack(">II", image[16:24])
        assert image.startswith(b"\x89PNG\r\n\x1a\n")
        assert image.endswith(b"IEND\xaeB`\x82")
        assert 70 < width == height < 200


def test_a_browser_may_run_the_scripts_of_the_page_and_fetch_nothing(report):
    """Of each script that is there the policy holds the hash, and nothing else."""
    (policy,) = map(html.unescape, re.findall(r'Content-Security-Policy" content="(.*?)"', report))
    scripts = re.findall(r"<script>(.*?)</script>", report, re.DOTALL)
    allowed = [f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in scripts]
    assert policy.split("; ") == [
        "default-src 'none'",
        f"script-src {' '.join(allowed)}",
        "style-src 'unsafe-inline'",
        "img-src data:",
        "base-uri 'none'",
        "form-action 'none'",
    ]
    assert len(scripts) == 9
    assert re.findall(r"<script(?! type=\"application/json\")(.*?)>", report) == [""] * 9
    assert not re.search(r"@import|url\(|<link|<iframe|javascript:", report)
    assert Page(report).links == [link for link in Page(report).links if link.startswith("data:image/png")]


def test_the_data_of_a_page_are_those_of_the_files(report, studied):
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', report)
    assert not set("<>&") & set(text)
    data = json.loads(text)
    assert data["figures"] == json.loads(json.dumps(figured(studied)))
    assert data["record"]["match"]["verdict"] == studied.match.verdict
    assert data["record"]["fits"][1]["parameters"]["alpha"]["value"] == pytest.approx(
        studied.posteriors[1].fit.values[6]
    )


def test_the_page_is_small_and_holds_the_licence_of_its_charts(report):
    """Six channels' worth of curves and two corners included; with spheres."""
    assert len(report.encode()) < 600_000
    assert "Permission is hereby granted, free of charge" in report


HOSTILE = ("<script>alert(1)</script>", "</script><img src=x onerror=alert(2)>", "{{7*7}}{%", "\u202eabc\u200b\x1b[31m")


def test_names_are_text(studied):
    """A file, a channel, a note, a reason and a command may be called anything."""
    evil = "".join(HOSTILE)
    posterior = studied.posteriors[0]
    measurements = dataclasses.replace(
        posterior.fit.measurements, source=evil, channels=(evil, "g", "b"), notes=(evil,), masked={evil: 1}
    )
    fit = dataclasses.replace(posterior.fit, measurements=measurements)
    one = alone(dataclasses.replace(posterior, fit=fit))
    page_ = rendering.to_html(record.to_dict(one, evil), figured(one))
    found = Page(page_)
    assert found.tags.count("script") == 10
    assert "49" not in found.text.partition(" samples")[0]
    assert not any(link.startswith("x") for link in found.links)
    assert "\u202e" not in page_
    assert r"\u202eabc\u200b\u001b[31m" in found.text
    assert found.text.count(HOSTILE[1] + HOSTILE[2]) >= 4


def test_outcomes_are_labelled(studied):
    posterior = studied.posteriors[1]
    odd = dataclasses.replace(posterior.fit, result="unidentifiable", undetermined=("eta", "ks"))
    text = Page(html_of(alone(dataclasses.replace(posterior, fit=odd, interrupted=True)))).text
    assert "lambert+ggx: At least one parameter is not determined by these angles: fix it" in text
    assert "Not determined: ks, eta." in text
    assert "sampling was interrupted; what was done is kept" in text


def test_json_has_the_agreed_keys(studied):
    found = json.loads(json.dumps(record.to_dict(studied), allow_nan=False))
    assert {"file", "n_samples", "n_masked", "channels", "fits", "match"} <= set(found)
    assert (found["file"], found["n_samples"], found["n_masked"]) == ("paint.csv", 51, 1)
    assert found["channels"] == ["r", "g", "b"]
    for fit, name in zip(found["fits"], NAMES, strict=True):
        assert fit["model"] == name
        assert fit["result"] == "converged"
        assert 1 <= fit["n_starts_agreeing"] <= fit["n_starts"]
        assert {"verdict", "ess_min", "rhat_max", "tau_max"} <= set(fit["posterior"])
        assert {"metrics", "aicc", "bic"} <= set(fit)
        for quantity in (*fit["parameters"].values(), *fit["derived"].values()):
            assert {"value", "sd", "ci95", "unit", "symbol"} <= set(quantity)
    match = found["match"]
    assert (match["empirical"], match["microfacet"]) == tuple(NAMES)
    for key in ("hemisphere_distance", "cube_root_distance", "albedo_gap_max", "implied_exponent"):
        assert match[key]["ci95"][0] <= match[key]["ci95"][1]
        assert math.isfinite(match[key]["value"])
    assert 0 <= match["albedo_gap_max"]["theta_i_deg"] <= 85
    assert match["verdict"] == studied.match.verdict


def test_json_lists_channels_and_not_what_they_share(studied):
    parameters = record.to_dict(studied)["fits"][1]["parameters"]
    assert np.shape(parameters["kd"]["value"]) == np.shape(parameters["kd"]["sd"]) == (3,)
    assert np.shape(parameters["kd"]["ci95"]) == (3, 2)
    # 51 samples of 2 % in each channel give kd to about 1 %: five standard deviations.
    assert parameters["kd"]["value"] == pytest.approx([0.4, 0.1, 0.2], rel=0.05)
    assert isinstance(parameters["alpha"]["value"], float)
    assert np.shape(parameters["alpha"]["ci95"]) == (2,)


def test_json_has_null_for_what_is_not_finite(studied):
    posterior = studied.posteriors[0]
    fit = dataclasses.replace(
        posterior.fit, log_likelihood=math.nan, likelihood_covariance=posterior.fit.covariance * math.inf
    )
    found: dict[str, Any] = record.to_dict(alone(dataclasses.replace(posterior, fit=fit)))
    text = json.dumps(found, allow_nan=False)
    assert json.loads(text)["fits"][0]["bic"] is None
    assert found["match"] is None


def test_report_makes_every_file(studied, tmp_path):
    assert fitmat.report(studied, tmp_path / "run") == tmp_path / "run" / "report.html"
    with pytest.raises(OutputError, match="already exists"):
        fitmat.report(studied, tmp_path / "run")
    tmp_path = tmp_path / "run"
    names = ["budget.txt", "figures.json", "fit.json", *(f"posterior-{name}.parquet" for name in NAMES), "report.html"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    draws, posterior = pl.read_parquet(tmp_path / names[4]), studied.posteriors[1]
    assert draws.columns[:4] == ["chain", "draw", "kd r", "kd g"]
    np.testing.assert_array_equal(draws["alpha"].to_numpy(), posterior.values[:, -2])
    texts, words = (tmp_path / "budget.txt").read_text(encoding="utf-8"), (tmp_path / "report.html").read_text("utf-8")
    for fit in json.loads((tmp_path / "fit.json").read_text())["fits"]:
        told = fit["budget"]
        assert f"Uncertainty budget of {fit['model']}\n" in texts
        assert told["words"] in words
        for line in told["quantities"].values():
            if line["parts"]:
                assert sum(u**2 for u in line["parts"].values()) == pytest.approx(line["u"] ** 2)
                assert line["U"] == pytest.approx(2.0 * line["u"])
    said = studied.findings[1].several_facets
    assert said.startswith("ggx counts light that meets one facet")
    assert said in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))["fits"][1]["several_facets"] == said


def torn(*_: object, **__: object) -> None:
    raise ValueError("no\nglyph")


@pytest.mark.parametrize("broken", ["figures.to_dict", "rendering.to_html", "files.write_text"])
def test_the_numbers_are_on_disk_before_anything_is_drawn(studied, tmp_path, monkeypatch, broken):
    """The record and the draws are those of a report that is whole."""
    (tmp_path / "whole").mkdir()
    assert page.write(tmp_path / "whole", studied) == ""
    numbers = {path.name: path.read_bytes() for path in (tmp_path / "whole").iterdir()}
    names = ["budget.txt", "figures.json", "fit.json", *(f"posterior-{name}.parquet" for name in NAMES), "report.html"]
    assert sorted(numbers) == names
    monkeypatch.setattr(f"fitmat.reports.page.{broken}", torn)
    sentence = r"report\.html could not be made \(ValueError: no glyph\); .* saved in fit\.json"
    with pytest.warns(UserWarning, match=sentence) as told:
        page.report(studied, tmp_path / "made")
    assert len(told) == 1
    made = {path.name: path.read_bytes() for path in (tmp_path / "made").iterdir()}
    assert sorted(set(numbers) - set(made)) == ["figures.json", "report.html"][broken != "figures.to_dict" :]
    assert numbers | made == numbers


def test_a_page_is_made_again_from_what_is_on_disk(studied, tmp_path):
    """The same page, letter by letter; never over one that is there unless that is asked for."""
    made = fitmat.report(studied, tmp_path / "run")
    before = made.read_text(encoding="utf-8")
    run = fitmat.load(tmp_path / "run")
    with pytest.raises(OutputError, match=r"report\.html: already exists; --force makes it again\."):
        fitmat.report(run)
    made.write_text("torn")
    assert fitmat.report(run, force=True).read_text(encoding="utf-8") == before
    made.unlink()
    assert fitmat.report(run).read_text(encoding="utf-8") == before
    with pytest.raises(
        FitmatError, match=r"folder is a .*, expected none: the page of a run stands beside its record\."
    ):
        fitmat.report(run, tmp_path / "elsewhere")


DAMAGES = {
    "no figures": (lambda run: (run / "figures.json").unlink(), r"figures\.json: No such file .*older.*\. Fit again\."),
    "torn figures": (
        lambda run: (run / "figures.json").write_text('{"form'),
        r"figures\.json is damaged \(.*\. Fit again",
    ),
    "a list": (lambda run: (run / "figures.json").write_text("[]"), r"figures\.json is damaged \(.*\. Fit again"),
    "later figures": (lambda run: edited(run / "figures.json", format=2), "is of format 2, expected 1. Fit again with"),
    "no curves": (lambda run: edited(run / "figures.json", curves=None), "lacks what a page shows .*: it is older, or"),
    "older record": (
        lambda run: edited(run / "fit.json", versions=None),
        "lacks what a page shows .*: it is older, or",
    ),
}


def edited(file: Path, **changes: Any) -> None:
    found = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps({key: value for key, value in (found | changes).items() if value is not None}))


@pytest.mark.parametrize(("damage", "sentence"), DAMAGES.values(), ids=DAMAGES)
def test_a_run_that_is_older_or_damaged_is_refused_in_a_sentence(studied, tmp_path, damage, sentence):
    page.write(tmp_path, studied)
    damage(tmp_path)
    before = (tmp_path / "report.html").read_bytes()
    with pytest.raises(ReadError, match=sentence) as refused:
        fitmat.report(fitmat.load(tmp_path), force=True)
    assert "\n" not in str(refused.value)
    assert (tmp_path / "report.html").read_bytes() == before


def test_only_the_files_of_a_run_are_its_own(tmp_path):
    """Those that its record names; a page or a record without that is somebody's."""
    (tmp_path / "fit.json").write_text(
        '{"fitmat": "0.1", "fits": [{"model": "ggx"}, {"model": "../x"}, {"model": "lost"}]}'
    )
    for name in (
        "report.html",
        "posterior-ggx.parquet",
        "posterior-mine.parquet",
        "posterior-ggx.nc",
        "notes.txt",
        "figures.json",
    ):
        (tmp_path / name).touch()
    assert page.own(tmp_path) == ["posterior-ggx.parquet", "report.html", "figures.json", "fit.json"]
    for content in ("{}", "torn", '{"fits": [{"model": "ggx"}]}', "[1]"):
        (tmp_path / "fit.json").write_text(content)
        with pytest.raises(
            OutputError, match=r"report\.html is not known to be of an earlier run, .*; move it, or give"
        ):
            page.own(tmp_path)
    (tmp_path / "report.html").unlink()
    with pytest.raises(OutputError, match=r"fit\.json is not known to be of an earlier run"):
        page.own(tmp_path)
    (tmp_path / "fit.json").unlink()
    with pytest.raises(OutputError, match=r"figures\.json is not known to be of an earlier run"):
        page.own(tmp_path)
    (tmp_path / "figures.json").unlink()
    assert page.own(tmp_path) == []


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (0.15032, 0.00101, "0.1503 ± 0.0010"),
        (117.3, 25.2, "117 ± 25"),
        (0.03, 0.25, "0.03 ± 0.25"),
        (1.5, math.nan, "1.5"),
        (0.0, 0.1, "0"),
        (2e-7, 3.0, "2e-07"),
        (3.4e66, 2.9e65, "3.4e+66 ± 2.9e+65"),
        (0.40637857925358, 1e-13, "0.4064"),
        (math.nan, 1.0, "–"),
    ],
)
def test_values_show_two_digits_of_their_error(value, sd, text):
    assert with_error(value, sd) == text


@pytest.mark.parametrize(
    ("low", "high", "sd", "text"),
    [
        (0.98251, 1.01001, 0.007, "0.9825 – 1.0100"),
        (0, 7.7e-5, 2e-5, "0 – 0.000077"),
        (0.006858, 0.9166, math.nan, "0.00686 – 0.917"),
        (1.2, 1.4e8, 3e7, "1.2 – 1.4e+08"),
    ],
)
def test_intervals_have_the_digits_of_their_value(low, high, sd, text):
    assert interval(low, high, sd) == text


def test_what_is_not_determined_shows_no_error(studied):
    posterior = studied.posteriors[1]
    fit = dataclasses.replace(posterior.fit, result="unidentifiable", undetermined=("eta",))
    told = record.fit_dict(find(dataclasses.replace(posterior, fit=fit), ()))
    found = {row["name"]: row for row in parameter_rows(plain(told), "rgb")}
    for name in ("eta", "f0"):
        assert found[name]["remark"] == "not determined"
        assert "±" not in found[name]["value"]
        assert "–" in found[name]["interval"]
    assert "±" in found["alpha"]["value"]


@pytest.mark.parametrize(
    "file", sorted((Path(page.__file__).parent / "templates").iterdir()), ids=lambda file: file.stem
)
def test_templates_have_no_arithmetic_but_percent(file):
    """A report formats; what it shows is computed elsewhere."""
    for expression in re.findall(r"{{(.*?)}}", file.read_text(encoding="utf-8")):
        left = re.sub(r'"[^"]*"', "", expression).replace("factor * ", "").replace("(u / line[]) ** 2", "")
        assert not re.search(r"[^\w'.]\s*[*/]\s|\*\*", left), expression


def test_the_command_that_tries_every_model_can_be_copied(studied: Study) -> None:
    """Whole, as a reader of the page was not there when it was made; none where the model follows the data."""
    found, drawn = record.to_dict(studied, "fitmat fit 'my paint.csv' --models ggx --seed 3"), figured(studied)
    assert "The command that tries every model" not in rendering.to_html(found, drawn)
    for fit in found["fits"]:
        fit["inadequate"] = True
    page_ = rendering.to_html(found, drawn)
    snippet = re.search(r'aria-label="The command that tries every model">([^<]*)</pre><button[^>]*>Copy', page_)
    assert snippet is not None
    assert html.unescape(snippet[1]) == "fitmat fit 'my paint.csv' --seed 3 --models all"


def test_bars_of_the_first_screen_have_numbers(studied: Study, report: str) -> None:
    """The limits of each interval beside its bar."""
    first = report.partition('<table class="mini">')[2].partition("</table>")[0]
    rows = [
        row for row in parameter_rows(record.to_dict(studied)["fits"][1], ["r", "g", "b"]) if row["kind"] == "fitted"
    ]
    assert first.count("<svg") == first.count(" – ") > 2
    assert sum(row["interval"] in first for row in rows) >= first.count("<svg")
