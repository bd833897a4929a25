"""Runs side by side: what the page says is what the runs say, nothing planted runs, and what is no run is refused."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from test_report import Page

import fitmat as fm
from fitmat.cli import compare
from fitmat.errors import OutputError, ReadError
from fitmat.reports.comparison import Comparison, compare_runs, to_html, write
from fitmat.studies.cards import cards

PLANTED = "<script>document.title='owned'</script>"


def run(folder: Path, kd: float, name: str) -> Path:
    """A run of a diffuse surface and of the pair that is matched."""
    theta_i, theta_o = np.deg2rad([10.0, 40.0]), np.deg2rad(np.linspace(-70.0, 70.0, 15))
    made = fm.model("lambert+ggx", kd=kd, alpha=0.3, eta=1.5)
    m = fm.simulate(made, theta_i, theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    study = fm.study(dataclasses.replace(m, source=name), "lambert+blinn-phong,lambert+ggx", sampling=False)
    return fm.report(study, folder).parent


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    place = tmp_path_factory.mktemp("runs")
    return [run(place / "one", 0.3, "paint.csv"), run(place / "two", 0.32, PLANTED)]


@pytest.fixture(scope="module")
def found(runs: list[Path]) -> Comparison:
    return compare_runs(runs)


def test_every_parameter_stands_beside_that_of_the_other_run(runs: list[Path], found: Comparison) -> None:
    """The difference in standard deviations from fit.json alone, and each value as the record has it."""
    told = [json.loads((one / "fit.json").read_text())["fits"][1]["parameters"]["kd"] for one in runs]
    line = next(one for one in found.lines if (one.model, one.name) == ("lambert+ggx", "kd"))
    apart = abs(told[0]["value"] - told[1]["value"]) / np.hypot(told[0]["sd"], told[1]["sd"])
    assert line.apart == pytest.approx(apart)
    assert line.words == f"differ: {apart:.2g} sd"
    assert [cell["best"] for cell in line.cells if cell] == [one["value"] for one in told]
    ends = [end for one in told for end in one["ci95"]]
    assert line.scale == (min(ends), max(ends))
    assert found.names == ("one", "two")
    assert found.matches["compared"] == ("Blinn–Phong with GGX",) * 2


def test_the_page_says_what_the_runs_say_and_runs_nothing(runs: list[Path], found: Comparison) -> None:
    page = to_html(found)
    read = Page(page)
    assert read.open == []
    text = read.text.replace("\u00a0", " ")
    for one in runs:
        for card in cards(json.loads((one / "fit.json").read_text())):
            assert card.sentence in text
    assert "script-src &#39;none&#39;" in page
    assert PLANTED not in page
    assert "<script" not in page
    assert not re.findall(r"(?:src|href)=\"(?!data:|#)", page)
    assert page.count('class="line model0"') == 2 * 2  # two incidences of each run
    assert len(page) < 300_000


def test_a_terminal_shows_the_same(found: Comparison, tmp_path: Path) -> None:
    screen = Console(width=100, record=True, force_terminal=False)
    compare.show(found, tmp_path / "page.html", screen)
    text = screen.export_text()
    for answers in found.answers:
        assert all(card.sentence in text for card in answers)
    assert re.search(r"kd +0\.\d+ ± 0\.\d+ +0\.\d+ ± 0\.\d+ +differ", text)


def test_what_is_no_run_is_refused(runs: list[Path], found: Comparison, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="1 run is given, expected two or more"):
        compare_runs(runs[:1])
    with pytest.raises(ReadError, match=r"fit\.json: No such file or directory; expected the folder of a run"):
        compare_runs([runs[0], tmp_path])
    with pytest.raises(ReadError, match="one is given twice, expected different runs"):
        compare_runs([runs[0], runs[0] / "fit.json"])
    page = write(found, tmp_path / "page.html")
    with pytest.raises(OutputError, match=r"page\.html: already exists; choose another name, or --force"):
        write(found, page)
    broken = tmp_path / "broken"
    broken.mkdir()
    told = json.loads((runs[0] / "fit.json").read_text())
    del told["match"]["perceived"]
    (broken / "fit.json").write_text(json.dumps(told))
    (broken / "figures.json").write_bytes((runs[0] / "figures.json").read_bytes())
    with pytest.raises(ReadError, match="a run lacks what is compared"):
        compare_runs([runs[1], broken])
