"""Shaders are run: their pixels are the model's own values, and the course's pair lights a sphere as we do.

Where there is no Chromium, what runs in it is skipped.
"""

import base64
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from lanes import mapped

import fitmat as fm
from fitmat.errors import ModelError, OutputError
from fitmat.exports import verification
from fitmat.exports.glsl import browser
from fitmat.exports.glsl.translation import ascii_only, translated
from fitmat.exports.verification import SHAPE, TOLERANCE, Difference, compared, directions, exact, run
from fitmat.models.base import AbstractBRDF
from fitmat.models.registry import LOBES, lobe_names

SHARP = {
    **{"alpha": 0.01, "alpha_x": 0.01, "alpha_y": 0.05, "rotation": 30.0, "b": 1e-6, "r": 0.7, "sigma_n": 20.0},
    **{"exponent": 4000.0, "exponent_u": 4000.0, "exponent_v": 100.0, "roughness": 0.1, "anisotropic": 0.5},
    **{"clearcoat": 0.5, "sheen": 0.5, "specular_tint": 0.5, "subsurface": 0.3, "metallic": 0.2},
    **{"base_color": [0.6, 0.3, 0.2], "f0": [0.04, 0.3, 0.9], "f82": 0.5, "kappa": 3.0, "kd": [0.1, 0.5, 0.9]},
}
"""As narrow as single precision is trusted, three colours, a turned tangent."""

COVERED = (
    "plastic",
    "varnish-over-lambert",
    "rough-varnish-over-lambert+ggx-conductor",
    "varnish-over-rough-varnish-over-phong",
)
"""Models under a face, which take a program each."""

FILMS = [name for name in LOBES if name.endswith("-film")]
NAMES = [*(n for n in LOBES if LOBES[n].kind != "cover" and n != "plastic" and n not in FILMS), *COVERED]
FEW = ("oren-nayar-full", "phong", "ward-aniso", "ashikhmin-shirley", "beckmann-kc-belcour", "disney-2015")
"""What every run executes; the study executes all."""


def sharp(name: str, values: Mapping[str, Any] = SHARP, masking: str | None = None) -> AbstractBRDF:
    """A model of three channels, with what it knows of the values."""
    known = {key for part in lobe_names(name) for key in LOBES[part].defaults()}
    own: dict[str, Any] = {key: np.array(value) for key, value in values.items() if key in known}
    return fm.model(name, masking=masking, channels=3, **own)


def chromium() -> str:
    found = browser.program()
    if found is None:
        pytest.skip("no Chromium: shaders are executed where a program called chromium or chrome is found")
    return found


def executed(models: Sequence[AbstractBRDF], sources: Sequence[str]) -> list[Difference]:
    """As `verification.difference`, for all in one start of the browser and without a program for each model."""
    wi, wo = directions()
    values, executor = run(sources, wi, wo, chromium())
    return [compared(found, own(m, *exact(wi, wo)), wi, wo, executor) for found, m in zip(values, models, strict=True)]


def own(model: AbstractBRDF, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """The model's values, without a program for it where that takes longer than the values."""
    if model.name in COVERED:
        return fm.evaluate(model, wi, wo)
    return mapped(lambda a, b: jnp.atleast_1d(model(a, b)), (), (wi, wo))[0]


def assert_equal(names: Sequence[str], models: Sequence[AbstractBRDF]) -> None:
    """Every one is; and one that is wrong by a thousandth more than what is allowed would not be."""
    sources = [translated(model) for model in models]
    wrong = re.sub(r"return (\w+\(wi, wo\));\n}\n$", rf"return {1.0 + 1.5 * TOLERANCE} * \1;\n}}\n", sources[-1])
    assert wrong != sources[-1]
    *found, broken = executed([*models, models[-1]], [*sources, wrong])
    far = {n: d.words for n, d in zip(names, found, strict=True) if not d.largest <= TOLERANCE}
    assert far == {}
    assert broken.beyond > 0.9 * broken.count * np.mean(np.minimum(*(w[:, 2] for w in directions())) > 0)
    assert all(d.mean < 0.02 * TOLERANCE for d in found)


def test_pixels_are_the_models_values() -> None:
    """To 2e-3, over 12,288 pairs of directions, of lobes of all kinds."""
    assert_equal(FEW, [sharp(name) for name in FEW])


@pytest.mark.study
def test_pixels_of_every_lobe_are_its_values() -> None:
    """The same for all, of sums and of other maskings, of grey, and of a tilted sample, which is exported level."""
    named = {name: sharp(name) for name in NAMES}
    named |= {f"{name} {m}": sharp(name, masking=m) for name in ("ggx", "beckmann") for m in ("separable", "v-cavity")}
    named["grey"] = fm.model("lambert+ggx", alpha=0.1)
    named["sum"] = sharp("oren-nayar+phong+ggx-aniso-conductor")
    named["last"] = sharp("ggx")
    assert len(named) > 55
    assert_equal(list(named), list(named.values()))


def test_directions_are_where_a_lobe_is_hard() -> None:
    """At least 10,000; the peak of the narrowest lobe, its tail, grazing, singular ones, and some below."""
    wi, wo = directions()
    assert wi.dtype == np.float32
    assert len(wi) == SHAPE[0] * SHAPE[1] >= 10_000
    light, eye = exact(wi, wo)
    up = (light[:, 2] > 0) & (eye[:, 2] > 0)
    h = (light + eye) / np.linalg.norm(light + eye, axis=1)[:, None]
    slope = np.hypot(h[:, 0], h[:, 1])[up] / h[up, 2]
    assert np.count_nonzero(~up) > 100
    assert np.count_nonzero(slope == 0) >= 20
    for low in 10.0 ** np.arange(-5.0, 0.0):
        assert np.count_nonzero((slope > low) & (slope < 10 * low)) > 500
    assert np.count_nonzero(np.minimum(light, eye)[up, 2] < np.cos(np.deg2rad(85.0))) > 1000


def test_what_is_not_finite_differs() -> None:
    wi, wo = directions()
    found = np.ones((len(wi), 3))
    found[7, 1] = np.nan
    told = compared(found, np.ones((len(wi), 1)), wi, wo, "nobody")
    assert (told.largest, told.beyond) == (np.inf, 1)


SPHERE = """<!doctype html><pre id="written"></pre><script type="application/json" id="given">GIVEN</script><script>
const given = JSON.parse(document.getElementById("given").textContent), size = given.size;
const gl = document.createElement("canvas").getContext("webgl2");
gl.getExtension("EXT_color_buffer_float");
const program = gl.createProgram();
for (const [kind, source] of [[gl.VERTEX_SHADER, given.vert], [gl.FRAGMENT_SHADER, given.frag]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
}
gl.linkProgram(program);
const log = [gl.getProgramInfoLog(program)];
gl.useProgram(program);
for (const name of ["mvpMatrix", "mvMatrix"]) {
    gl.uniformMatrix4fv(gl.getUniformLocation(program, name), false, given[name]);
}
for (const name of ["source", "emission"]) gl.uniform3fv(gl.getUniformLocation(program, name), given[name]);
for (const [name, value] of Object.entries(given.floats)) gl.uniform1f(gl.getUniformLocation(program, name), value);
const points = [];
const at = (i, j) => {
    const t = Math.PI * i / given.rings, p = 2 * Math.PI * j / given.rings;
    return [Math.sin(t) * Math.cos(p), Math.cos(t), Math.sin(t) * Math.sin(p)];
};
for (let i = 0; i < given.rings; ++i) for (let j = 0; j < given.rings; ++j) {
    for (const [a, b] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) points.push(...at(i + a, j + b));
}
gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STATIC_DRAW);
for (const place of [0, 2]) {
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
}
for (const [format, attachment] of [[gl.RGBA32F, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
    if (attachment === gl.COLOR_ATTACHMENT0) gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    const target = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, target);
    gl.renderbufferStorage(gl.RENDERBUFFER, format, size, size);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, target);
}
gl.viewport(0, 0, size, size);
gl.enable(gl.DEPTH_TEST);
gl.drawArrays(gl.TRIANGLES, 0, points.length / 3);
const found = new Float32Array(4 * size * size);
gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, found);
let letters = "";
const all = new Uint8Array(found.buffer);
for (let k = 0; k < all.length; k += 4096) letters += String.fromCharCode(...all.subarray(k, k + 4096));
document.getElementById("written").textContent = JSON.stringify({ log, error: gl.getError(), pixels: btoa(letters) });
</script>"""

KD = np.array([0.1, 0.2, 0.3])

HOSTILE = "it's \"é*/ --> </script>\\ \n#error \u202e\x1b[31m"
"""Ends of comments, of lines, of pages and of strings, other letters, and a backslash before the end of a line."""


SIZE, FAR, WIDE = 256, 3.0, 2.0
"""Pixels, distance of the ball of radius 1, and cotangent of half the angle of view."""

LIGHT, EMISSION = np.array([2.0, 1.5, -0.5]), np.array([3.0, 2.0, 1.0])

GILT = fm.model("lambert+ggx-aniso-schlick", kd=KD, f0=np.array([0.9, 0.6, 0.3]), alpha_x=0.3, alpha_y=0.6)


def drawn(files: Mapping[str, str], **floats: float) -> np.ndarray:
    """Pixels of the ball that a pair of shaders lights from the side, (SIZE, SIZE, 4), rows from below."""
    shaders = {name.rpartition(".")[2]: text for name, text in files.items()}
    view = np.eye(4)
    view[2, 3] = -FAR
    near, back = 1.0, 10.0
    project = np.diag([WIDE, WIDE, (back + near) / (near - back), 0.0])
    project[2, 3], project[3, 2] = 2.0 * back * near / (near - back), -1.0
    told = {"size": SIZE, "rings": 200, "source": LIGHT.tolist(), "emission": EMISSION.tolist(), "floats": floats}
    told |= {"mvMatrix": view.T.ravel().tolist(), "mvpMatrix": (project @ view).T.ravel().tolist()}
    given = json.dumps(told | {"vert": shaders["vert"], "frag": shaders["frag"]}).replace("<", "\\u003c")
    told = json.loads(browser.written(SPHERE.replace("GIVEN", given), chromium()))
    assert (told["log"], told["error"]) == ([""], 0)
    return np.frombuffer(base64.b64decode(told["pixels"]), "<f4").reshape(SIZE, SIZE, 4).astype(float)


def met() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which pixels see the ball, (SIZE²,), where in the frame of the eye, (n, 3), and the ball's normal there."""
    place = (np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0
    ray = np.stack([*np.meshgrid(place / WIDE, place / WIDE), -np.ones((SIZE, SIZE))], axis=-1).reshape(-1, 3)
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    along = -FAR * ray[:, 2]
    square = along**2 - FAR**2 + 1.0
    inside = square > 0.05  # the rim of the triangles is not that of the ball
    position = ray[inside] * (along[inside] - np.sqrt(square[inside]))[:, None]
    return inside, position, position - [0.0, 0.0, -FAR]


def radiance(model: AbstractBRDF, position: np.ndarray, n: np.ndarray) -> np.ndarray:
    """f · I · cosθ_i/d² where a normal is n, (n, 3), the tangent around the object's y axis."""
    t = np.cross([0.0, 1.0, 0.0], n)
    t /= np.linalg.norm(t, axis=1)[:, None]
    frame = np.stack([t, np.cross(n, t), n], axis=1)
    beam = LIGHT - position
    distance = np.linalg.norm(beam, axis=1)
    eye = -position / np.linalg.norm(position, axis=1)[:, None]
    wi, wo = (np.einsum("nij,nj->ni", frame, w) for w in (beam / distance[:, None], eye))
    lit = np.maximum(wi[:, 2], 0.0) / distance**2
    return fm.evaluate(model, wi, wo) * EMISSION * lit[:, None]


def test_the_pair_lights_a_sphere_as_we_do() -> None:
    """A ball of radius 1 three away, brushed and gold-like, lit from the side: f · I · cosθ_i/d² at every pixel.

    The triangles are 1/200 of a turn, their corners on a raster of 1/256 pixel: that leaves 2e-3 of the largest value.
    """
    pixels = drawn(fm.export(GILT, "glsl", name=HOSTILE, verify=False).files)
    inside, position, n = met()
    expected = radiance(GILT, position, n)
    found = pixels.reshape(-1, 4)[inside]
    assert np.count_nonzero(expected.max(axis=1) > 0) > 10_000
    assert np.abs(found[:, :3] - expected).max() < 2e-3 * expected.max()
    assert np.abs(found[:, :3] - 1.01 * expected).max() > 2e-3 * expected.max()
    assert np.array_equal(found[:, 3], np.ones(len(found)))
    assert pixels[0, 0].tolist() == [0.0] * 4


def test_a_name_is_a_comment_and_nothing_else() -> None:
    """Whatever it holds: the code is the same, in ASCII, and no line of it is the name's."""
    model = fm.model("lambert")
    plain, odd = (fm.export(model, name=name, verify=False) for name in ("plain", HOSTILE))
    assert "it-s-é-script-error-31m.glsl" in odd.files
    for benign, hostile in zip(plain.files.values(), odd.files.values(), strict=True):
        if benign.startswith("{"):
            assert json.loads(hostile)["name"] == HOSTILE
            continue
        assert hostile.isascii()
        code = [[line for line in text.splitlines() if not line.startswith("//")] for text in (benign, hostile)]
        assert code[0] == code[1]
        assert not any(line.endswith("\\") for line in hostile.splitlines())


@pytest.mark.parametrize("name", ["..", "/", "a/../b", "", ".hidden", "CON\x00", "x" * 300, "*/", "--", "\ud800"])
def test_files_have_names_that_stay_in_the_folder(name: str) -> None:
    for file in fm.export(fm.model("lambert"), name=name, verify=False).files:
        assert re.fullmatch(r"\w[\w+.-]{0,90}\.(glsl|vert|frag|json)", file), file
        assert file.isprintable()


def test_a_lobe_says_its_formula() -> None:
    """The shader begins with the formula of the manual, its numbers have their own names, and nothing is unused."""
    text = translated(fm.model("lambert+ggx-schlick", kd=0.25, alpha=0.125, f0=np.array([0.5, 0.25, 0.125])))
    assert "// f = ks F(c_d) D(h) G(w_i, w_o)/(4 c_i c_o)" in text
    assert "const vec3 lambert_kd = vec3(0.25);" in text
    assert "const float ggx_schlick_alpha = 0.125;" in text
    assert "const vec3 ggx_schlick_f0 = vec3(0.5, 0.25, 0.125);" in text
    assert "return lambert(wi, wo) + ggx_schlick(wi, wo);" in text
    assert "conductor" not in text
    declared = re.findall(r"^(?:const )?(?:float|vec2|vec3|Pair) (\w+)", text, re.MULTILINE)
    assert all(len(re.findall(rf"\b{name}\b", text)) > 1 for name in declared if name != "brdf")


def test_formulas_are_written_in_ascii() -> None:
    for name in NAMES:
        if name not in COVERED:
            assert translated(sharp(name)).isascii(), name
    assert ascii_only("½ + √π θ²ⁿ⁻¹ · ω_i·h − Δφ\x07") == "1/2 + sqrtpi theta^2n-1 * w_i.h - Deltaphi\\u0007"


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: fm.model("lambert+ggx-walk"), "ggx-walk.* is estimated and has no formula; ggx-kc has"),
        (
            lambda: fm.model("rough-varnish-over-varnish-over-lambert"),
            "rough-varnish-over-varnish-over-lambert is not tran",
        ),
        (lambda: fm.model("lambert", channels=2), "kd has 2 channels, expected 1 or 3: a shader has three colours"),
        (lambda: fm.model("ggx-conductor", channels=31), "has 31 channels, expected 1 or 3"),
    ],
)
def test_what_a_shader_cannot_hold_is_refused(build: Callable[[], AbstractBRDF], sentence: str) -> None:
    with pytest.raises(ModelError, match=sentence):
        translated(build())


def test_a_browser_that_fails_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    model = fm.model("lambert")
    for program, sentence in [("/nowhere/chromium", r"cannot run a shader \(No such file"), ("true", "wrote nothing")]:
        monkeypatch.setattr(browser, "program", lambda program=program: program)
        with pytest.raises(OutputError, match=sentence):
            verification.difference(model, translated(model))
    monkeypatch.setattr(browser, "PATIENCE", 0.2)
    monkeypatch.setattr(browser, "program", lambda: "sh")
    monkeypatch.setattr(browser, "FLAGS", ("-c", "sleep 60 #"))
    with pytest.raises(OutputError, match=r"it did not end within 0\.2 s"):
        verification.difference(model, translated(model))


@pytest.mark.study
def test_a_shader_that_does_not_compile_is_said() -> None:
    chromium()
    wrong = translated(fm.model("lambert")).replace("lambert_kd /", "kd /")
    with pytest.raises(OutputError, match=r"the shader cannot be run \(ERROR: 0:\d+: 'kd' : undeclared identifier"):
        verification.difference(fm.model("lambert"), wrong)
