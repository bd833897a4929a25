"""The ball is run in Chromium: its pixels are the models' own values, and its controls change what they say."""

import base64
import json
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.exports.glsl import browser
from fitmat.match.appearance import scene
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector, with_vector
from fitmat.reports import ball

EXTENT = 1.04
"""Half of the picture's width; as `static/scene.js`."""

TOLERANCE = 2e-3
"""Relative: single precision, where the light falls in and the viewer looks at more than 1° above the surface."""

GOLD = np.array([0.99, 0.71, 0.29])
MODELS: tuple[AbstractBRDF, ...] = (
    fm.model("lambert+blinn-phong", kd=np.array([0.5, 0.1, 0.05]), ks=np.array([0.1, 0.2, 0.3]), exponent=200.0),
    fm.model("lambert+ggx", kd=np.array([0.5, 0.1, 0.05]), ks=1.0, alpha=0.1, eta=1.5),
    fm.model("oren-nayar+phong", channels=3),
    fm.model("ggx-aniso-schlick", alpha_x=0.1, alpha_y=0.4, rotation=30.0, f0=GOLD),
    fm.model("beckmann-kc-f82", alpha=0.5, f82=0.8, f0=GOLD),
    fm.model("disney-2012", base_color=np.array([0.1, 0.3, 0.6]), clearcoat=1.0, sheen=0.5),
    fm.model("ashikhmin-shirley", channels=3),
    fm.model("lambert", kd=np.array([0.3, 0.5, 0.7])),
)
"""Both default models, and others of every kind; in pairs, as a page has them."""

PAGE = """<!doctype html><pre id="written"></pre><div id="root"></div>
<script type="application/json" id="given">GIVEN</script>
<script>
const heard = [];
for (const kind of ["error", "warn"]) console[kind] = (...words) => heard.push(words.join(" "));
onerror = (words) => heard.push(words);
</script>
<script>SCRIPT</script>
<script>
const given = JSON.parse(document.getElementById("given").textContent), root = document.getElementById("root");
function packed(floats) {
    const all = new Uint8Array(floats.buffer);
    let letters = "";
    for (let k = 0; k < all.length; k += 4096) letters += String.fromCharCode(...all.subarray(k, k + 4096));
    return btoa(letters);
}
function mounted(data) {
    const ball = mountBall(root, data);
    if (ball === undefined) throw new Error(root.textContent);
    ball.size = ball.gpu.canvas.width = ball.gpu.canvas.height = 96;
    ball.state.lit = "light";
    return ball;
}
function radiance(ball, k) {
    const target = ball.rendered(k), found = ball.gpu.pixels(target);
    ball.gpu.remove(target);
    return { across: target.width, light: [...ball.state.light], pixels: packed(found) };
}
// What a view shows, as bytes of red, green, blue and opacity, rows from above.
function shown(ball, k) {
    ball.draw();
    const { canvas } = ball.views[k];
    return [...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data];
}
function control(label) {
    const row = [...root.querySelectorAll("label")].find((each) => each.firstChild.textContent.trim() === label);
    if (row === undefined) throw new Error(`no control ${label}`);
    return row.querySelector("input, select");
}
function slide(label, share) {
    const input = control(label);
    input.value = share;
    input.dispatchEvent(new Event("input"));
}
function press(words) {
    const named = [...root.querySelectorAll("button")].filter((button) => button.textContent.startsWith(words));
    named.forEach((button) => button.click());
}
let answer;
try {
    answer = (() => { TEST })();
} catch (error) {
    heard.push(error.stack);
}
document.getElementById("written").textContent = JSON.stringify({ heard, answer });
</script>"""


def executed(test: str, given: Any) -> Any:
    """What a test's script returns on a page with the ball; the page must have had nothing to complain of."""
    program = browser.program()
    if program is None:
        pytest.skip("no Chromium: the ball is drawn where a program called chromium or chrome is found")
    page = PAGE.replace("TEST", test, 1).replace("GIVEN", json.dumps(given).replace("<", "\\u003c"), 1)
    found = json.loads(browser.written(page.replace("SCRIPT", ball.script(), 1), program))
    assert found["heard"] == []
    return found["answer"]


def given(*models: AbstractBRDF, draws: int = 0) -> dict[str, Any]:
    """What a page has of a pair of models, and of each some draws, about it."""
    rng, made = np.random.default_rng(0), []
    for model in models:
        fit = np.asarray(vector(model), float)
        rows = np.concatenate([[fit], [0.9 * fit], [1.1 * fit], fit * rng.uniform(0.8, 1.2, (draws, len(fit)))])
        made.append(ball.material(model.name, model, rows, "rgb"))
    return ball.page_data(made, ("r", "g", "b"), 3)


def seen(across: int) -> tuple[np.ndarray, np.ndarray]:
    """Which pixels, rows from below, see the ball, and the frames of its surface there, tangent along the parallels."""
    place = (2.0 * (np.arange(across) + 0.5) / across - 1.0) * EXTENT
    x, y = np.meshgrid(place, place)
    inside = x**2 + y**2 < 1.0
    x, y = x[inside], y[inside]
    return inside, scene.tangents(np.stack([x, y, np.sqrt(1.0 - x * x - y * y)], axis=1))


def towards(angle: float, direction: float) -> np.ndarray:
    return scene.frame(np.deg2rad(angle), np.deg2rad(direction))[2]


def far(model: AbstractBRDF, found: dict[str, Any]) -> float:
    """The largest relative difference of pixels from π f cosθ_i, over the lit hemisphere."""
    across = found["across"]
    pixels = np.frombuffer(base64.b64decode(found["pixels"]), "<f4").reshape(across, across, 4).astype(float)
    inside, surface = seen(across)
    assert (pixels[~inside] == 0.0).all()
    pixels = pixels[inside]
    wi, wo = surface @ towards(*found["light"]), surface[:, :, 2]
    lit = (wi[:, 2] > np.sin(np.deg2rad(1.0))) & (wo[:, 2] > np.sin(np.deg2rad(1.0)))
    assert np.count_nonzero(lit) > 0.2 * across**2
    assert (pixels[wi[:, 2] < -1e-3, :3] == 0.0).all()
    expected = np.pi * fm.evaluate(model, wi[lit], wo[lit]) * wi[lit, 2:]
    return float((np.abs(pixels[lit, :3] - expected) / np.maximum(expected, 1e-12)).max())


@pytest.mark.study
def test_pixels_of_the_ball_are_the_models_values() -> None:
    """Of both default models and six others, at 20,000 pixels each; not so of a shader that is wrong by 0.5 %."""
    pairs = [given(*MODELS[k : k + 2]) for k in range(0, len(MODELS), 2)]
    broken = given(*MODELS[:2])
    for made in broken["models"]:
        made["source"] = made["source"].replace("return lambert(", "return 1.005 * lambert(")
    test = """return given.flatMap((pair) => {
        const ball = mounted(pair);
        return [radiance(ball, 0), radiance(ball, 1)];
    });"""
    *found, wrong, _ = executed(test, [*pairs, broken])
    apart = {model.name: far(model, pixels) for model, pixels in zip(MODELS, found, strict=True)}
    assert {name: size for name, size in apart.items() if size > TOLERANCE} == {}
    assert far(MODELS[0], wrong) > TOLERANCE


@pytest.mark.study
def test_controls_change_what_they_say() -> None:
    """Sliders of parameters, reset, shake, both of the light, dragging it, wipe, factor of the difference, exposure."""
    test = """
    const ball = mounted(given), found = { begun: radiance(ball, 1), names: given.models.map(({ role }) => role) };
    const lit = () => radiance(ball, 1);
    slide("α", 0.4);
    found.alpha = ball.values[1][4];
    found.rougher = [radiance(ball, 0), lit()];
    press("Reset");
    found.reset = lit();
    press("Shake");
    found.shaken = [radiance(ball, 0), lit()];
    press("Reset");
    slide("Light from viewer", 0.5);
    slide("Light on screen", 0.25);
    found.lit = lit();
    const { canvas } = ball.views[0], box = canvas.getBoundingClientRect();
    canvas.setPointerCapture = () => {};
    const at = { clientX: box.left + box.width * 0.7, clientY: box.top + box.height * 0.5, pointerId: 1, buttons: 1 };
    canvas.dispatchEvent(new PointerEvent("pointerdown", at));
    canvas.dispatchEvent(new PointerEvent("pointerup", at));
    found.dragged = lit();
    slide(`${found.names[0]} | ${found.names[1]}`, 1);
    found.first = shown(ball, 0);
    slide(`${found.names[0]} | ${found.names[1]}`, 0.25);
    found.wiped = [shown(ball, 0), shown(ball, 1)];
    found.apart = shown(ball, 2);
    slide("Difference", 1);
    found.further = shown(ball, 2);
    slide("Exposure", 0.25);
    found.darker = shown(ball, 1);
    slide("Fine waves", 0.5);
    found.waves = shown(ball, 1);
    control("Shape").selectedIndex = 1;
    control("Shape").dispatchEvent(new Event("change"));
    found.dents = shown(ball, 1);
    slide("Orbit around", 0.8);
    found.orbit = shown(ball, 1);
    return found;
    """
    phong, ggx = MODELS[:2]
    told = given(phong, ggx, draws=3)
    found = executed(test, told)
    assert far(ggx, found["begun"]) < TOLERANCE
    rougher = np.array(told["models"][1]["fit"])
    assert 0.01 < found["alpha"] < 0.99
    assert found["alpha"] != rougher[4]
    rougher[4] = found["alpha"]
    assert far(phong, found["rougher"][0]) < TOLERANCE
    assert far(with_vector(ggx, rougher), found["rougher"][1]) < TOLERANCE
    assert far(ggx, found["rougher"][1]) > 10 * TOLERANCE
    assert found["reset"] == found["begun"]
    for k, model in enumerate((phong, ggx)):
        drawn = with_vector(model, np.array(told["models"][k]["draws"][0]))
        assert far(drawn, found["shaken"][k]) < TOLERANCE < far(model, found["shaken"][k])
    assert found["lit"]["light"] == [90.0, 90.0]
    assert far(ggx, found["lit"]) < TOLERANCE
    angle, direction = found["dragged"]["light"]
    assert angle == pytest.approx(2.0 * np.rad2deg(np.arcsin(0.4 * EXTENT)), abs=2.0)
    assert min(direction, 360.0 - direction) < 2.0
    assert far(ggx, found["dragged"]) < TOLERANCE
    first, wiped, second, apart, further, darker, waves, dents, orbit = (
        np.array(each, float).reshape(96, 96, 4)
        for each in (
            found["first"], *found["wiped"],
            *(found[name] for name in ("apart", "further", "darker", "waves", "dents", "orbit")),
        )
    )  # fmt: skip
    assert np.abs(wiped[:, :23] - first[:, :23]).max() == 0.0
    assert np.abs(wiped[:, 26:] - second[:, 26:]).max() == 0.0
    assert np.abs(first - second).max() > 10.0
    assert np.abs(further - apart).mean() > 1.0
    assert 0.2 < darker[..., :3].mean() / second[..., :3].mean() < 0.8
    for one, other in ((waves, darker), (dents, waves), (orbit, dents)):
        assert np.abs(one - other)[..., :3].mean() > 0.5


@pytest.mark.study
def test_the_sky_is_that_of_the_spheres() -> None:
    """Against an integral over the hemisphere by another rule: 1 % with 2,000 directions, 10 % with those of a page."""
    test = """
    const ball = mounted(given);
    ball.size = 32;
    ball.state.lit = "sky";
    ball.rounds = 48;
    const few = [radiance(ball, 0), radiance(ball, 1)];
    ball.rounds = 500;
    return [...few, radiance(ball, 0), radiance(ball, 1)];
    """
    models = fm.model("lambert", kd=np.array([0.3, 0.5, 0.7])), fm.model("ggx-schlick", alpha=0.3, f0=GOLD)
    cos, turn = np.meshgrid((np.arange(400) + 0.5) / 400, 2.0 * np.pi * (np.arange(800) + 0.5) / 800)
    sin = np.sqrt(1.0 - cos**2)
    wi = np.stack([sin * np.cos(turn), sin * np.sin(turn), cos], axis=-1).reshape(-1, 3)
    allowed = zip((*models, *models), executed(test, given(*models)), (0.1, 0.1, 0.01, 0.01), strict=True)
    for model, found, most in allowed:
        across = found["across"]
        inside, surface = seen(across)
        pixels = np.frombuffer(base64.b64decode(found["pixels"]), "<f4").reshape(across, across, 4)[inside]
        chosen = np.flatnonzero(surface[:, 2, 2] > 0.3)[::200]
        expected = []
        for axes in surface[chosen]:
            f = fm.evaluate(model, wi, np.tile(axes[:, 2], (len(wi), 1)))
            expected.append(scene.radiance(wi @ axes) * wi[:, 2] @ f * 2.0 * np.pi / len(wi))
        assert np.abs(pixels[chosen, :3] / expected - 1.0).max() < most


@pytest.mark.study
def test_without_webgl_there_is_a_sentence_and_the_stills() -> None:
    test = """
    HTMLCanvasElement.prototype.getContext = () => null;
    mountBall(root, given, { lambert: "data:image/png;base64,AA==" });
    return [root.textContent, root.querySelectorAll("img[alt='Lit ball of lambert']").length];
    """
    words, pictures = executed(test, given(fm.model("lambert", channels=3), fm.model("phong", channels=3)))
    assert words == "The ball cannot be drawn in this browser: no WebGL 2.lambert"
    assert pictures == 1
