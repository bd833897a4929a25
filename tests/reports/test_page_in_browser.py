"""The page in a real Chromium: it draws, answers to whoever points, types or chooses, and obeys nothing else.

What a test does to a page stands in scripts that are added to it, with their hashes: no others may run.
"""

import base64
import dataclasses
import hashlib
import json
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.exports.glsl import browser
from fitmat.reports import page, rendering
from fitmat.studies import figures, record
from fitmat.studies.study import Study, study

NAMES = ("lambert+blinn-phong", "lambert+ggx")

WATCH = """
var seen = {wrong: [], asked: []};
addEventListener("error", event => seen.wrong.push(event.message));
addEventListener("securitypolicyviolation", event => seen.asked.push(event.violatedDirective + " " + event.blockedURI));
console.error = console.warn = (...words) => seen.wrong.push(words.join(" "));
"""
"""Before all others: what goes wrong, and what was to be fetched or run in vain."""

TELL = """
addEventListener("load", () => setTimeout(async () => {
  try { ACTIONS } catch (error) { seen.wrong.push(String(error)); }
  const all = document.createElement("pre");
  all.id = "written";
  all.textContent = JSON.stringify(seen);
  document.body.append(all);
}, 200));
function painted(canvas) {
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return new Set(new Uint32Array(data.buffer)).size > 3;
}
function settled() { return new Promise(done => setTimeout(done, 50)); }
function every(selector) { return [...document.querySelectorAll(selector)]; }
function input(words) { return labelled(words).querySelector("input"); }
function labelled(words) { return every("label").find(label => label.textContent.trim() === words); }
function pixels() { return every("#panels canvas").map(canvas => canvas.toDataURL()).join(); }
function press(element, key) {
  element.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true, cancelable: true}));
}
"""

LOOK = """
  seen.width = innerWidth;
  seen.beyond = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  seen.dark = getComputedStyle(document.documentElement).backgroundColor;
  document.getElementById("sure").open = true;
  document.getElementById("sure").dispatchEvent(new Event("toggle"));
  seen.painted = every("canvas").filter(canvas => !canvas.closest("#ball")).map(painted);
  seen.resources = performance.getEntriesByType("resource").map(entry => entry.name);
  seen.pwned = window.pwned;
  seen.still = getComputedStyle(document.getElementById("static-curves")).display;
"""
"""What is there without touching anything."""


@pytest.fixture(scope="module")
def chromium() -> str:
    found = browser.program()
    if found is None:
        pytest.skip("no Chromium: pages are looked at where a program called chromium or chrome is found")
    return found


@pytest.fixture(scope="module")
def studied() -> Study:
    """Three channels, three incidences, 17 directions each."""
    truth = fm.model("lambert+ggx", channels=3, kd=np.array([0.4, 0.1, 0.2]), alpha=0.3)
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    m = fm.simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    return study(dataclasses.replace(m, source="paint.csv"), NAMES, sampling=False)


def html_of(found: Study) -> str:
    return rendering.to_html(record.to_dict(found), page.figured(found))


def look(text: str, chromium: str, actions: str, monkeypatch: pytest.MonkeyPatch, *flags: str) -> dict[str, Any]:
    """What scripts see in a page that is opened with more flags."""
    before, after = WATCH, TELL.replace("ACTIONS", actions)
    hashes = "".join(
        f" 'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in (before, after)
    )
    text = text.replace("; style-src", f"{hashes.replace(chr(39), '&#39;')}; style-src", 1)
    text = text.replace("<title>", f"<script>{before}</script><title>", 1)
    text = text.replace("</body>", f"<script>{after}</script></body>")
    monkeypatch.setattr(browser, "FLAGS", (*browser.FLAGS, *flags))
    return json.loads(browser.written(text, chromium))


@pytest.mark.study
@pytest.mark.parametrize(
    ("flags", "background"),
    [
        (("--window-size=1280,900",), "rgb(255, 255, 255)"),
        (("--window-size=500,900", "--blink-settings=preferredColorScheme=0"), "rgb(18, 22, 27)"),
    ],
    ids=["wide and light", "narrow and dark"],
)
def test_every_figure_is_drawn_and_nothing_fetched(studied, chromium, monkeypatch, flags, background) -> None:
    """Curves with residuals of three incidences, albedo, distance and corner; nothing beyond the edge."""
    seen = look(html_of(studied), chromium, LOOK, monkeypatch, *flags)
    assert (seen["wrong"], seen["asked"], seen["resources"]) == ([], [], [])
    assert (seen["painted"], seen["beyond"], seen["still"]) == ([True] * 9, 0, "none")
    assert seen["dark"] == background
    assert seen["width"] in (500, 1280)


UNFOLD = """
  for (const id of ["curve-table", "sure"]) {
    document.getElementById(id).open = true;
    document.getElementById(id).dispatchEvent(new Event("toggle"));
  }
  seen.rows = every("#curve-table tbody tr").length;
"""

TOUCH = """
  const drawn = {start: pixels()};
  seen.labels = every(".panel").map(p => p.getAttribute("aria-label"));
  for (const words of ["linear", "95 % bands", "lambert+ggx", "20°"]) {
    input(words).click();
    await settled();
    drawn[words] = pixels();
  }
  seen.left = every(".panel").map(p => p.getAttribute("aria-label"));
  seen.changed = Object.values(drawn).map((one, k, all) => k && one !== all[k - 1]);
  for (const words of ["lambert+ggx", "20°"]) input(words).click();
  const again = every(".panel")[1];
  await settled();
  for (let k = 0; k < 3; k++) press(again, "ArrowRight");
  seen.told = again.querySelector(".readout").textContent;
  await settled();
  const whole = pixels();
  press(again, "+");
  seen.zoomed = !document.getElementById("whole").disabled;
  await settled();
  seen.closer = pixels() !== whole;
  press(again, "0"); seen.whole = document.getElementById("whole").disabled;
  const channel = every("select").find(s => s.options[0].textContent === "r");
  channel.selectedIndex = 2; channel.dispatchEvent(new Event("change"));
  const third = every(".panel")[1];
  press(third, "ArrowRight"); seen.blue = third.querySelector(".readout").textContent;
  const corner = () => document.querySelector("#corner canvas").getAttribute("aria-label");
  seen.corners = [corner()];
  const model = document.getElementById("corner-model");
  model.selectedIndex = 0; model.dispatchEvent(new Event("change"));
  seen.corners.push(corner());
  seen.reachable = every("input, select, button, summary, .panel, .badge").filter(e => e.tabIndex < 0).length;
  seen.nameless = every("input, select").filter(e => !e.labels.length || !e.labels[0].textContent.trim()).length;
"""


@pytest.mark.study
def test_what_is_touched_changes_what_it_should(studied, chromium, monkeypatch) -> None:
    """Scale, bands, models, incidences and channels; keys walk along the points and zoom; all is reached by keys."""
    seen = look(html_of(studied), chromium, UNFOLD + TOUCH, monkeypatch, "--window-size=1280,900")
    assert seen["wrong"] == []
    assert seen["changed"] == [0, True, True, True, True]
    assert len(seen["labels"]) == 3
    assert all(label.startswith("incidence ") and "lambert+ggx within 2 standard" in label for label in seen["labels"])
    assert len(seen["left"]) == 2
    assert not any("lambert+ggx" in label for label in seen["left"])
    assert (seen["zoomed"], seen["closer"], seen["whole"], seen["rows"]) == (True, True, True, 3 * 51)
    one = figures.to_dict(studied)["curves"][1]
    for told, place, k in ((seen["told"], 2, 1), (seen["blue"], 0, 2)):
        value = float(f"{one['measured'][k][place]:.4g}")
        assert told.startswith(f"θₒ {one['theta_o'][place]:g}°: measured {value:g} sr⁻¹")
    assert [label.split()[2] for label in seen["corners"]] == ["lambert+ggx", "lambert+blinn-phong"]
    assert "correlation" in seen["corners"][0]
    assert (seen["reachable"], seen["nameless"]) == (0, 0)


ANYWHERE = """
  seen.scales = [];
  for (const yRange of [[0.0097, 0.5], [0.0043, 0.9], [0.00976, 3], [0.0123, 40], [0.3, 2]]) {
    const place = document.body.appendChild(document.createElement("div"));
    const series = [{label: "a", values: [0.4, 0.5, 0.45], colour: "#112233"}];
    const chart = fitmat.chart(place, {x: [0, 1, 2], series, yScale: "log", xRange: [0, 2], yRange, label: "x"});
    await settled();
    seen.scales.push(chart.axes[1]._values.filter(Boolean));
  }
"""


@pytest.mark.study
def test_logarithmic_scales_begin_anywhere(studied, chromium, monkeypatch) -> None:
    """The ticks of the library never ended where a scale does not begin at a power of ten."""
    seen = look(html_of(studied), chromium, ANYWHERE, monkeypatch, "--window-size=1280,900")
    assert seen["wrong"] == []
    assert seen["scales"][0] == ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5"]
    assert seen["scales"][3] == ["0.1", "1", "10"]


TOLD_APART = """
  const models = fitmat.data.figures.models;
  seen.dashes = models.map(name => String(fitmat.modelDash(name)));
  seen.keys = every("#curve-controls .key").map(key => getComputedStyle(key).backgroundImage.includes("transparent")
    || getComputedStyle(key).backgroundImage.includes("rgba(0, 0, 0, 0)"));
  seen.printed = getComputedStyle(document.querySelector(".legend.printed")).display;
  seen.named = document.querySelector(".legend.printed").textContent;
"""


@pytest.mark.study
def test_models_differ_in_more_than_colour(studied, chromium, monkeypatch) -> None:
    """In the dash of their lines, in charts and legends; on paper, where the controls are not, a legend names them."""
    seen = look(html_of(studied), chromium, TOLD_APART, monkeypatch, "--window-size=1280,900")
    assert seen["wrong"] == []
    assert len(set(seen["dashes"])) == len(NAMES)
    assert seen["keys"] == [True, False]
    assert seen["printed"] == "none"
    assert all(name in seen["named"] for name in (*NAMES, "measured"))


@pytest.mark.study
def test_planted_scripts_do_not_run(studied, chromium, monkeypatch) -> None:
    """In the names of the file, of channels and of models' words, which all reach charts and texts."""
    evil = "<script>window.pwned=1</script></script><img src=x onerror='window.pwned=2'>{{7*7}}\u202e"
    posteriors = [found.posterior for found in studied.findings]
    m = dataclasses.replace(studied.measurements, source=evil, channels=(evil, f"g{evil}", "b"), notes=(evil,))
    hostile = [
        dataclasses.replace(
            found, learnt=(), posterior=dataclasses.replace(p, fit=dataclasses.replace(p.fit, measurements=m))
        )
        for found, p in zip(studied.findings, posteriors, strict=True)
    ]
    text = html_of(dataclasses.replace(studied, findings=tuple(hostile), warnings=(evil,)))
    seen = look(text, chromium, LOOK + UNFOLD, monkeypatch)
    assert (seen["wrong"], seen["asked"], seen.get("pwned")) == ([], [], None)
    # Were one planted all the same, the policy would stop it: here one is.
    planted = look(text.replace("<main>", "<main><img src='https://example.org/x.png'><script>window.pwned=3</script>"),
        chromium, LOOK, monkeypatch)  # fmt: skip
    assert planted.get("pwned") is None
    assert sorted(words.split()[0] for words in planted["asked"]) == ["img-src", "script-src-elem"]


@pytest.mark.study
def test_maps_and_a_single_model_are_drawn(hemisphere, chromium, monkeypatch) -> None:
    wi, wo = np.tile(hemisphere(1, 3), (300, 1)), hemisphere(300, 2)
    value = 0.1 + 0.05 * wo[:, :1] ** 2
    m = fm.Measurements(wi, wo, value, 0.01 * value, value > 0, ("value",))
    text = html_of(study(m, ["lambert"], sampling=False))
    change = 'const map = document.getElementById("map-kind"), before = every("#maps canvas")[0].toDataURL();'
    change += 'map.selectedIndex = 1; map.dispatchEvent(new Event("change"));'
    change += 'seen.label = every("#maps canvas")[0].getAttribute("aria-label");'
    change += 'seen.changed = before !== every("#maps canvas")[0].toDataURL();'
    change += 'seen.painted = every("#maps canvas").map(painted);'
    seen = look(text, chromium, change, monkeypatch)
    assert (seen["wrong"], seen["asked"], seen["changed"], seen["painted"]) == ([], [], True, [True])
    assert "300 of 300 points; the largest residual" in seen["label"]
