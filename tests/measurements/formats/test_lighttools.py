"""LightTools files: libbsdf's reading of them, blocks of channels and sides, and faults."""

from pathlib import Path

import numpy as np
import pytest
from test_zemax import outcomes

from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import lighttools, zemax

EXACT = 1e-12
"""Absolute, radians: angles pass through a handful of float64 operations."""

HEAD = """# made by hand
Source Measured
Symmetry Asymmetric
SpectralContent {content}
ScatterAzimuth 4
0 90 180 270
ScatterRadial 3
0 30 60
DataBegin
"""
BLOCK = """AOI {aoi}
POI {poi}
Side {side}
Wavelength {nm}
ScatterType {kind}
{more}TIS 0.5
{first} 2 3
{first} 5 6
{first} 8 9
{first} 11 12
"""
PLAIN = {"aoi": 30, "poi": 0, "side": "Front", "nm": 0, "kind": "BRDF", "more": "", "first": 1}


def text(*blocks: dict[str, object], content: str = "Monochrome") -> str:
    """A file of these blocks, each as far as it differs from a plain one."""
    body = "".join(BLOCK.format(**{**PLAIN, **block}) for block in blocks)
    return HEAD.format(content=content) + body + "DataEnd\n"


def sample(rng: np.random.Generator) -> bytes:
    """A valid file: several incidences, of one channel, of two wavelengths or of X, Y and Z, and a block behind."""
    blocks: list[dict[str, object]] = []
    content = str(rng.choice(["Monochrome", "XYZ"]))
    channels = rng.choice(["", "X"]) if content == "Monochrome" else "XYZ"
    for aoi in np.sort(rng.choice(np.arange(0, 90, 5), 3, replace=False)):
        first = f"{rng.lognormal():.4g}"
        if content == "XYZ":
            blocks += [{"aoi": aoi, "first": first, "more": f"TristimulusValue Tris{name}\n"} for name in channels]
        else:
            blocks += [{"aoi": aoi, "first": first, "nm": nm} for nm in ((450, 650) if channels else (550,))]
    blocks.append({"aoi": 10, "side": "Back", "more": "TristimulusValue TrisX\n"})
    return text(*blocks, content=content).encode()


@pytest.fixture
def write(tmp_path: Path):
    def to_file(content: str | bytes) -> Path:
        path = tmp_path / "a.bsdf"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return to_file


def test_the_light_comes_from_azimuth_90(write):
    """libbsdf turns the outgoing azimuths by −90° and sets the light's to 0: 270° is the mirror side."""
    found = reader.read(write(text({})))
    at60 = np.isclose(found.theta_o, np.deg2rad(60))
    assert found.value[at60, 0].tolist() == [3, 6, 9, 12]
    np.testing.assert_allclose(found.phi[at60], np.deg2rad([90, 0, 90, 180]), atol=EXACT)
    np.testing.assert_allclose(found.wi, np.tile([0.5, 0, np.sqrt(0.75)], (12, 1)), atol=EXACT)
    mirror = found.value[:, 0] == 11
    np.testing.assert_allclose(found.wo[mirror], found.wi[mirror] * [-1, -1, 1], atol=EXACT)


def test_the_normal_counts_once(write):
    found = reader.read(write(text({}, {"aoi": 50, "first": 7})))
    assert found.masked == {"the same value of a direction once more, for another azimuth": 6}
    assert found.n_samples == 24


def test_xyz_blocks_are_channels_in_any_order(write):
    blocks = [
        {"aoi": a, "first": a + k, "more": f"TristimulusValue Tris{c}\n"} for a in (10, 20) for k, c in enumerate("XZY")
    ]
    found = reader.read(write(text(*blocks, content="XYZ")))
    assert set(found.channels) == {"x", "y", "z"}
    columns = [found.channels.index(name) for name in "xyz"]
    assert found.value[[0, 12]][:, columns].tolist() == [[10, 12, 11], [20, 22, 21]]


def test_wavelengths_are_channels(write):
    found = reader.read(write(text({"nm": 650, "first": 4}, {"nm": 450.5, "first": 3})))
    assert found.channels == ("450.5", "650")
    assert found.value[0].tolist() == [3, 4]


def test_the_back_side_and_transmission_are_counted_and_not_read(write):
    found = reader.read(write(text({}, {"side": "Back", "aoi": 170, "poi": 5}, {"kind": "BTDF", "first": 9})))
    assert found.value.max() == 12
    assert found.n_samples == 12
    assert "Blocks not read, of the back side or of transmission: 2." in found.notes


BAD: dict[str, tuple[str, str]] = {
    "no front": (text({"side": "Back"}, {"kind": "BTDF"}), "2 blocks, none of which is a BRDF of the front side"),
    "no blocks": (text(), "0 blocks, none of which is a BRDF of the front side, expected one. fitmat fits"),
    "planes": (text({}, {"poi": 45}), r"planes of incidence \(POI\) 0, 45, expected one, their sense is not published"),
    "angle": (text({"aoi": 120}), "row 15: the block of this line has AOI 120, expected an angle of 0 to 90 degrees"),
    "no angle": (
        text({}).replace("AOI 30\n", ""),
        r"row 14: the block of this line has AOI \(none\), expected an angle",
    ),
    "wavelength": (text({"nm": "blue"}), "has WAVELENGTH blue, expected a number from 0"),
    "tristimulus": (text({}, content="XYZ"), r"TristimulusValue \(none\), expected TrisX, TrisY or TrisZ"),
    "symmetry": (text({}).replace("Asymmetric", "Rotational"), "row 3: Symmetry rotational, expected asymmetric or"),
    "content": (text({}, content="RGB"), "row 4: SpectralContent rgb, expected monochrome or xyz"),
    "cut off": (text({})[:-20], r"row 15: \d+ numbers in the block that begins here, expected 12 \(4 × 3 angles\)"),
    "count": (text({}).replace("Radial 3", "Radial 3000000000"), "row 7: ScatterRadial 3000000000 with 3 angles below"),
    "keyword": (text({}).replace("Side", "Face"), "row 12: face, expected a keyword of the format"),
    "stray": (text({}).replace("POI 0", "POI 0\n7"), "row 11: numbers below poi, expected none"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write, content, message):
    with pytest.raises(ReadError, match=message):
        lighttools.load(write(content))


def test_it_claims_its_own_content_only():
    raw = text({}).encode()
    for content in (raw, b"\xef\xbb\xbf" + raw, raw.replace(b"\n", b"\r")):
        assert lighttools.claims(content, len(content))
        assert not zemax.claims(content, len(content))
    for other in (b"theta_i,theta_o,aoi\n1,2,3\n", b"aoi,brdf\n1,2\n", b"", b"\x00" * 99):
        assert not lighttools.claims(other, len(other))


def test_no_fault_raises_anything_but_a_read_error(write):
    read, refused = outcomes(sample, write, np.random.default_rng(14))
    assert read > 20 < len(refused)
    assert not any("\n" in message for message in refused)
