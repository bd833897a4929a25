"""The page of a batch: every file with its answer, inert, its table sorted and cut down in a browser."""

import base64
import hashlib
import json
import re
from typing import Any

import pytest

from fitmat.exports.glsl import browser
from fitmat.reports import summary

PLANTED = "<script>document.title='owned'</script>"


def line(name: str, **more: Any) -> dict[str, Any]:
    cards = {card: f"{card} of {name}." for card in ("material", "phong", "trust")}
    levels = {f"{card}_level": "good" for card in cards}
    return {"name": name, "swatch": None, "delta_e": None, "distance": None, "misfit": None} | cards | levels | more


def test_every_file_stands_in_it_and_nothing_planted_runs() -> None:
    page = summary.to_html([line("a.csv", delta_e=1.234), line(PLANTED)], [{"message": f"bad.csv: {PLANTED}"}])
    assert "<h1>2 of 3 files fitted</h1>" in page
    assert 'data-value="1.234">1.23</td>' in page
    assert "material of a.csv." in page
    assert PLANTED not in page
    assert page.count("&lt;script&gt;document.title") == 5  # the name, three sentences, the message
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src &#39;sha256-{digest}&#39;;" in page
    assert "http" not in page.replace("http-equiv", "").replace("http://www.w3.org", "")


def test_a_batch_without_a_fit_has_a_page() -> None:
    page = summary.to_html([], [{"message": "bad.csv: nothing"}])
    assert "<h1>0 of 1 files fitted</h1>" in page
    assert "<table" not in page


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
