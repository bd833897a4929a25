"""What a file says that its values add up to, beside what they do: closed forms of a Lambertian surface."""

import re
from pathlib import Path

import numpy as np
import pytest

import fitmat as fm
from fitmat.judgement.examination.examining import Examination, examine
from fitmat.measurements.formats import zemax
from fitmat.measurements.joining import join
from fitmat.measurements.parsing import blocks
from fitmat.measurements.samples import Measurements

ALBEDO = 0.4
ALARM = "scattered in all (TIS)"


def zemax_file(folder: Path, tis: list[float], *, theta_i: tuple[float, ...] = (20.0, 50.0)) -> Path:
    """Lambertian, ∫ (a/π) cosθ dω = a, on a grid about the mirror direction, with these TIS."""
    angles = np.meshgrid(np.deg2rad(theta_i), np.deg2rad(np.arange(0, 181, 10.0)), np.deg2rad(np.arange(0, 146.0, 5)))
    lit, azimuth, radial = (a.ravel() for a in angles)
    wo = blocks.around(lit, np.zeros_like(lit), radial, azimuth)
    kept = (wo[:, 2] > 1e-6) & ((radial > 0) | (azimuth == 0))
    wi = np.stack([np.sin(lit), np.zeros_like(lit), np.cos(lit)], axis=1)
    value = np.full((int(kept.sum()), 1), ALBEDO / np.pi)
    text = zemax.dump(Measurements(wi[kept], wo[kept], value, None, value > 0, ("value",)))
    path = folder / "lambert.bsdf"
    stated = iter(tis)
    path.write_text(re.sub(r"TIS\t\S+", lambda _: f"TIS\t{next(stated):.6g}", text), encoding="utf-8")
    return path


def alarm(found: Examination) -> str:
    return next((warning for warning in found.warnings if ALARM in warning), "")


def test_a_sum_that_is_right_raises_no_alarm(tmp_path: Path) -> None:
    found = examine(fm.read(zemax_file(tmp_path, [ALBEDO, ALBEDO])))
    assert alarm(found) == ""
    assert [a.stated.tolist() for a in found.albedos] == [[ALBEDO], [ALBEDO]]


@pytest.mark.parametrize("wrong", [ALBEDO * 2, ALBEDO / np.pi, 1.0], ids=["no cosine", "no π", "placeholder"])
def test_another_sum_is_said_where_it_is(tmp_path: Path, wrong: float) -> None:
    """Of a Lambertian surface the integral without the cosine is 2a; some writers put 1 where they know nothing."""
    found = examine(fm.read(zemax_file(tmp_path, [ALBEDO, wrong])))
    assert re.search(rf"at 50° it says {wrong:.3g}, and they add up to 0\.4\d*", alarm(found))
    assert "at 20°" not in alarm(found)
    first = found.as_dict()["channels"]["value"]["implied_albedo"]
    assert [round(entry["stated"], 5) for entry in first] == [ALBEDO, round(wrong, 5)]


def test_none_is_stated_where_it_is_0(tmp_path: Path) -> None:
    found = examine(fm.read(zemax_file(tmp_path, [0.0, 0.0])))
    assert alarm(found) == ""
    assert found.as_dict()["channels"]["value"]["implied_albedo"][0]["stated"] is None


def test_an_unknown_scale_has_no_sum_to_compare(tmp_path: Path) -> None:
    assert alarm(examine(fm.read(zemax_file(tmp_path, [0.8, 0.8]), unknown_scale=True))) == ""


def test_a_joined_file_keeps_its_sum(tmp_path: Path) -> None:
    wrong = fm.read(zemax_file(tmp_path, [0.8, 0.8]))
    other = fm.read(zemax_file(tmp_path, [ALBEDO] * 2, theta_i=(30.0, 60.0)))
    said = alarm(examine(join([wrong, other])))
    assert re.findall(r"at (\d+)°", said) == ["20", "50"]


def test_lighttools_states_it_block_by_block(tmp_path: Path) -> None:
    """X at 0.4 right, Y at 0.8 wrong, of one Lambertian surface; the back side is no one's."""
    angles = np.arange(0, 90, 5)
    head = "Source Measured\nSymmetry Asymmetric\nSpectralContent XYZ\nScatterAzimuth 12\n"
    head += " ".join(map(str, range(0, 360, 30))) + f"\nScatterRadial {len(angles)}\n{' '.join(map(str, angles))}\n"
    rows = (" ".join([f"{ALBEDO / np.pi:.6f}"] * len(angles)) + "\n") * 12
    block = "AOI 30\nPOI 0\nSide {}\nWavelength 0\nScatterType BRDF\nTristimulusValue Tris{}\nTIS {}\n"
    said = [("Front", "X", ALBEDO), ("Front", "Y", 2 * ALBEDO), ("Front", "Z", ALBEDO), ("Back", "X", 0.9)]
    path = tmp_path / "paint.bsdf"
    path.write_text(head + "DataBegin\n" + "".join(block.format(*words) + rows for words in said) + "DataEnd\n")
    found = examine(fm.read(path))
    assert found.albedos[0].stated.tolist() == [ALBEDO, 2 * ALBEDO, ALBEDO]
    assert "at 30° in channel y it says 0.8, and they add up to 0.4" in alarm(found)


def test_a_study_warns_of_it_too(tmp_path: Path) -> None:
    from fitmat.judgement.examination.examining import warnings
    from fitmat.measurements.noise import measured_noise

    m = fm.read(zemax_file(tmp_path, [0.8, 0.8]))
    assert any(ALARM in warning for warning in warnings(m, measured_noise(m)))


def test_a_file_of_ours_says_its_own_sum(shared_data: Path, tmp_path: Path) -> None:
    """The published file states another one than its values have (0.039 for 0.052 ± 0.002); written anew, theirs."""
    m = fm.read(shared_data / "ua-loft/zemax/AnoBlackEC1onAlum.bsdf")
    assert "at 10° it says 0.0387, and they add up to 0.051" in alarm(examine(m))
    (tmp_path / "again.bsdf").write_text(zemax.dump(m), encoding="utf-8")
    assert alarm(examine(fm.read(tmp_path / "again.bsdf"))) == ""
