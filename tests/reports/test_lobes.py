"""The lobes are run in Chromium: what is drawn are the models' own values, at the places where it says so."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from test_ball import MODELS, executed, given

import fitmat as fm
from fitmat.maths.directions import from_angles
from fitmat.models.base import AbstractBRDF

CURVES = [
    {"theta_i": 30.0, "phi_i": 0.0, "theta_o": [-30.0, 0.0, 30.0], "measured": [[0.1, 0.2, None], [0.3, 0.4, 0.5]]},
    {"theta_i": 60.0, "phi_i": 0.0, "theta_o": [60.0], "measured": [[0.7], [0.8]]},
]
"""Of channels g and r, one value masked."""


def radii(points: str) -> tuple[np.ndarray, np.ndarray]:
    """Of a polyline: angles from the normal in degrees, and distances from the middle."""
    x, y = np.array([[float(part) for part in place.split(",")] for place in points.split()]).T
    return np.rad2deg(np.arctan2(x, -y)), np.hypot(x, y)


def in_plane(model: AbstractBRDF, theta_i: float, theta_o: np.ndarray) -> np.ndarray:
    """Values in the plane of incidence, theta_o positive on the mirror side, degrees; light at azimuth 0."""
    wi = from_angles(np.full(len(theta_o), np.deg2rad(theta_i)), np.zeros(len(theta_o)))
    return fm.evaluate(model, wi, from_angles(np.deg2rad(theta_o), np.full(len(theta_o), np.pi)))


@pytest.mark.study
def test_lobes_and_slices_are_the_models_values() -> None:
    """The drawn radii, cube root and linear; points only where measured; both slices; all follow the ball's sliders."""
    test = """
    const ball = mounted(given.ball), place = document.createElement("div");
    root.after(place);
    const lobes = mountLobes(place, ball, given.curves, ["g", "r"]), found = {};
    const drawn = () => [...place.querySelectorAll("polyline")].map((line) => line.getAttribute("points"));
    const at = (label, share) => {
        const row = [...place.querySelectorAll("label")].find((each) => each.firstChild.textContent === label);
        const input = row.querySelector("input, select");
        input.value = share;
        input.dispatchEvent(new Event(input.tagName === "INPUT" ? "input" : "change"));
    };
    found.begun = [lobes.thetaI, place.querySelectorAll("svg[role] circle").length, drawn()];
    at("Incidence θi", 29 / 85);
    found.near = [lobes.thetaI, place.querySelectorAll("svg[role] circle").length];
    at("Radius", "linear");
    at("Channel", "1");
    found.linear = [place.querySelectorAll("svg[role] circle").length, drawn()];
    found.plane = lobes.shown;
    found.residuals = place.querySelectorAll(".slice circle").length;
    at("Slice", "90");
    found.across = lobes.shown;
    found.none = place.querySelectorAll(".slice circle").length;
    found.image = lobes.slices.map(({ canvas }) => canvas.getContext("2d").getImageData(45, 45, 1, 1).data[3]);
    const { directions, surfaces, points, most } = lobes.solids;
    const painted = () => lobes.solids.canvases.map((canvas) => canvas.toDataURL());
    found.solid = { at: directions, surfaces, points, most };
    const before = painted();
    at("Orbit around", 0.9);
    at("Orbit over", 1);
    found.orbited = [lobes.solids.view, painted().map((url, k) => url !== before[k])];
    slide("α", 0.4);
    ball.draw();
    found.solidMoved = lobes.solids.surfaces[1][0].some((part, axis) => Math.abs(part - surfaces[1][0][axis]) > 1e-3);
    found.moved = [ball.values[1][4], lobes.shown[1][0]];
    return found;
    """
    models = MODELS[:2]
    found = executed(test, {"ball": given(*models), "curves": CURVES})
    for theta_i, (lines, channel, power) in {
        60.0: (found["begun"][2], 0, 1 / 3),
        30.0: (found["linear"][1], 1, 1),
    }.items():
        shapes = [radii(line) for line in lines]
        values = [in_plane(m, theta_i, angle)[:, channel] for m, (angle, _) in zip(models, shapes, strict=True)]
        top = max(v.max() for v in values)
        for (angle, radius), value in zip(shapes, values, strict=True):
            assert len(angle) > 400
            assert np.abs(radius - 100.0 * (value / top) ** power).max() < 1.0
    assert found["begun"][:2] == [60.0, 1]
    assert found["near"] == [30.0, 3]
    assert found["linear"][0] == 2  # g has a masked value
    cell = np.array([12.5, 40.5])
    row, column = 89 - 40, 12
    h = np.array([np.sin(np.deg2rad(cell[0])), 0.0, np.cos(np.deg2rad(cell[0]))])
    for key, across in (("plane", np.cross([0.0, 1.0, 0.0], h)), ("across", np.array([0.0, 1.0, 0.0]))):
        wi, wo = (np.cos(np.deg2rad(cell[1])) * h + s * np.sin(np.deg2rad(cell[1])) * across for s in (1.0, -1.0))
        for model, values in zip(models, found[key], strict=True):
            assert values[90 * row + column] == pytest.approx(fm.evaluate(model, wi[None], wo[None])[0, 1], rel=1e-3)
    assert found["residuals"] == 2 * 3
    assert found["none"] == 0
    assert found["image"] == [255, 255, 255]
    assert found["moved"][1] != found["across"][1][0]
    solids(found, models)


def solids(found: dict[str, Any], models: Sequence[AbstractBRDF]) -> None:
    """Linear in channel r, light from 30°: a lobe reaches as far as the value is of the largest that is drawn."""
    solid = found["solid"]
    at = np.array([one["at"] for one in solid["at"]])
    wo = np.stack([-at[:, 0], -at[:, 1], at[:, 2]], axis=1)  # x is the mirror side, which lies at azimuth 180°
    wi = np.broadcast_to(from_angles(np.deg2rad([30.0]), np.zeros(1)), wo.shape)
    values = [fm.evaluate(model, wi, wo)[:, 1] for model in models]
    assert solid["most"] == pytest.approx(max(v.max() for v in values), rel=2e-2)
    for value, surface in zip(values, solid["surfaces"], strict=True):
        assert np.abs(np.linalg.norm(surface, axis=1) - value / solid["most"]).max() < 1e-2
    points = np.array(solid["points"])
    assert np.rad2deg(np.arctan2(points[:, 0], points[:, 2])) == pytest.approx([-30.0, 0.0], abs=1e-6)
    assert np.linalg.norm(points, axis=1) * solid["most"] == pytest.approx([0.1, 0.2])
    assert found["orbited"] == [[144, 90], [True, True]]
    assert found["solidMoved"]


@pytest.mark.study
def test_without_measured_sections_there_are_lobes_all_the_same() -> None:
    test = """
    const place = document.body.appendChild(document.createElement("div"));
    const { thetaI } = mountLobes(place, mounted(given), [], []);
    return [thetaI, place.querySelectorAll("polyline").length, place.textContent.includes("Nothing was measured")];
    """
    assert executed(test, given(MODELS[1])) == [45, 1, True]
