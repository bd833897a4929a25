"""The page of a batch: every file with its answer, inert, its table sorted and cut down in a browser."""

import base64
import hashlib
import json
import re
from typing import Any

import pytest

from fitmat.exports.glsl import browser
from fitmat.reports import summary

LIBRARY = "https://github.com/leeoniya/uPlot"

PLANTED = "<script>document.title='owned'</script>"


def line(name: str, **more: Any) -> dict[str, Any]:
    cards = {card: f"{card} of {name}." for card in ("material", "phong", "trust")}
    levels = {f"{card}_level": "good" for card in cards}
    numbers = {"delta_e": None, "distance": None, "misfit": None}
    return {"name": name, "swatch": None, "link": "", "columns": {}} | numbers | cards | levels | more


def test_every_file_stands_in_it_and_nothing_planted_runs() -> None:
    drawn = {"alpha": 0.2, PLANTED: 1.0}, {"alpha": 0.3, PLANTED: 2.0}
    files = [line("a.csv", delta_e=1.234, columns=drawn[0]), line(PLANTED, columns=drawn[1])]
    page = summary.to_html(files, [{"message": f"bad.csv: {PLANTED}"}])
    assert "<h1>2 of 3 files fitted</h1>" in page
    assert 'data-value="1.234">1.23</td>' in page
    assert "material of a.csv." in page
    assert PLANTED not in page
    assert page.count("&lt;script&gt;document.title") == 7  # the name, three sentences, the message, two choices
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    assert len(digests) == 3
    assert f"script-src {' '.join(f'&#39;sha256-{digest}&#39;' for digest in digests)};" in page
    assert "http" not in page.replace("http-equiv", "").replace("http://www.w3.org", "").replace(LIBRARY, "")


def test_a_batch_without_a_fit_has_a_page() -> None:
    page = summary.to_html([], [{"message": "bad.csv: nothing"}])
    assert "<h1>0 of 1 files fitted</h1>" in page
    assert "<table" not in page


def test_a_line_leads_to_the_page_of_its_file() -> None:
    page = summary.to_html([line("a.csv", link="runs/a%20b/report.html"), line("b.csv")], [])
    assert '<th scope="row"><a href="runs/a%20b/report.html">a.csv</a></th>' in page
    assert '<th scope="row">b.csv</th>' in page
    assert 'id="scatter"' not in page  # there are no numbers to draw


ASKED = """<script>
addEventListener("load", () => {
  const cells = () => [...document.querySelectorAll("#files tbody tr:not([hidden]) th")];
  const names = () => cells().map((cell) => cell.textContent);
  const found = { first: names() };
  const head = (k) => document.querySelectorAll("button.sort")[k];
  head(4).click(); found.rising = names();
  head(4).click(); found.falling = names();
  head(0).click(); found.named = names();
  const filter = document.getElementById("filter");
  filter.value = "b2"; filter.dispatchEvent(new Event("input")); found.cut = names();
  const told = document.createElement("pre");
  told.id = "written"; told.textContent = JSON.stringify(found);
  document.body.append(told);
});
</script>"""


@pytest.mark.study
def test_the_table_is_sorted_and_cut_down() -> None:
    """By number with what has none at the end, by name as people count, and to the rows with a word."""
    chromium = browser.program()
    if chromium is None:
        pytest.skip("there is no Chromium here; install one to run pages")
    files = [line("b10.csv", delta_e=2.0), line("b2.csv", delta_e=10.0), line("a.csv")]
    page = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", summary.to_html(files, []))
    found = json.loads(browser.written(page.replace("</body>", ASKED + "</body>"), chromium))
    assert found["first"] == ["b10.csv", "b2.csv", "a.csv"]
    assert found["rising"] == ["b10.csv", "b2.csv", "a.csv"]
    assert found["falling"] == ["b2.csv", "b10.csv", "a.csv"]
    assert found["named"] == ["a.csv", "b2.csv", "b10.csv"]
    assert found["cut"] == ["b2.csv"]


POINTED = """<script>
addEventListener("load", async () => {
  const over = () => document.querySelector("#scatter .u-over");
  const told = () => document.getElementById("point").textContent;
  const later = () => new Promise((done) => setTimeout(done, 20));
  const all = async () => {
    const box = over().getBoundingClientRect(), found = new Set();
    for (let x = 2; x < box.width; x += 8) for (let y = 2; y < box.height; y += 8) {
      over().dispatchEvent(new MouseEvent("mousemove", {clientX: box.left + x, clientY: box.top + y, bubbles: true}));
      if (told()) found.add(told());
    }
    return [...found].sort();
  };
  const words = () => [document.getElementById("drawn").textContent, document.getElementById("scatter").ariaLabel
    ?? document.getElementById("scatter").getAttribute("aria-label")];
  const wrong = [];
  addEventListener("error", (event) => wrong.push(event.message));
  const offered = [...document.getElementById("across").options].map((one) => one.value);
  const found = {wrong, offered, first: words()};
  await later();
  found.points = await all();
  for (const [id, name] of [["up", "alpha"], ["across", "seconds"]]) {
    const choice = document.getElementById(id);
    choice.value = name; choice.dispatchEvent(new Event("change"));
  }
  await later();
  found.other = [words(), await all()];
  const filter = document.getElementById("filter");
  filter.value = "b.csv"; filter.dispatchEvent(new Event("input"));
  await later();
  found.cut = [words()[0], await all()];
  over().click();
  const made = document.createElement("pre");
  made.id = "written"; made.textContent = JSON.stringify(found);
  document.body.append(made);
});
</script>"""


@pytest.mark.study
def test_any_number_is_drawn_against_any_other() -> None:
    """A point for each file that has both, its interval in words; wide ranges are logarithmic; the filter holds."""
    chromium = browser.program()
    if chromium is None:
        pytest.skip("there is no Chromium here; install one to run pages")
    files = [
        line(
            "a.csv",
            columns={"alpha": 0.1, "alpha_low": 0.05, "alpha_high": 0.2, "misfit_over_noise": 1.0, "seconds": 0.0121},
        ),
        line("b.csv", columns={"alpha": 0.3, "misfit_over_noise": 2.0, "seconds": 0.9}),
        line("c.csv", columns={"alpha": 0.4, "seconds": 0.3, "misfit_over_noise": float("nan"), "same": 5}),
    ]
    page = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", summary.to_html(files, []))
    found = json.loads(browser.written(page.replace("</body>", POINTED + "</body>"), chromium))
    assert found["wrong"] == []
    assert found["offered"] == ["alpha", "misfit_over_noise", "seconds"]  # what never differs cannot be drawn
    assert found["first"][0] == "2 of 3 files have both numbers."
    assert found["first"][1].startswith("misfit_over_noise against alpha of 2 files")
    assert found["points"] == [
        "a.csv: alpha 0.1 (0.05 to 0.2), misfit_over_noise 1",
        "b.csv: alpha 0.3, misfit_over_noise 2",
    ]
    assert found["other"][0][1].startswith("alpha against seconds (logarithmic) of 3 files")
    assert [text.split(": ")[1].split(",")[0] for text in found["other"][1]] == [
        "seconds 0.0121",
        "seconds 0.9",
        "seconds 0.3",
    ]
    assert found["cut"] == ["1 of 1 files have both numbers.", ["b.csv: seconds 0.9, alpha 0.3"]]
