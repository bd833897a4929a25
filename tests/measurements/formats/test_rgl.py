"""RGL-EPFL materials: evaluation against Mitsuba 3.9's `measured`, the file's grid as rows, and damaged files.

The database's files cannot be had without its server, so the materials are made up here, in the layout that
`measured.cpp` demands, with zero patches in the densities and in the measured factor.

Measured, relative differences of f_r cos θ_o, 12,000 pairs each, half of them around the mirror direction; RGB, and
four wavelengths, alike. "Beyond": pairs that differ by more than 10⁻⁴, all beside a patch where the factor s is zero.
Grazing angles are no exception (cos θ_o < 0.05: 6·10⁻⁵ at most). The last column is of rows instead of pairs.

=====================================  ========  =========  ======  ====================
material                               median    worst      beyond  rows: worst (number)
=====================================  ========  =========  ======  ====================
isotropic, 1 or 2 azimuths             1.4·10⁻⁷  5·10⁻⁶     0       3·10⁻⁶ (310)
isotropic, one incidence               1.4·10⁻⁷  3·10⁻⁵     0       1·10⁻⁶ (70)
5 azimuths over 90°, mirrored          2.1·10⁻⁷  1.5·10⁻³   2       2·10⁻⁶ (1,275)
5 azimuths over 180°, turned           1.9·10⁻⁷  8·10⁻⁴     3       2·10⁻⁶ (1,327)
9 azimuths over 360°                   1.9·10⁻⁷  5·10⁻⁴     4       3·10⁻⁶ (2,304)
8 azimuths over 90°, 32² and 128²      2.2·10⁻⁷  4·10⁻⁵     0       4·10⁻⁶ (30,759)
=====================================  ========  =========  ======  ====================
"""

import struct
import tracemalloc
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
from conftest import Hemisphere
from test_tensor import MUTATORS

from fitmat.errors import ModelError, ReadError
from fitmat.maths.warp import Blend, Warp
from fitmat.measurements.formats import rgl
from fitmat.measurements.parsing import tensor
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements

SINGLE = 1e-4
"""Relative; Mitsuba adds and subtracts single-precision integrals."""

FLOOR = 1e-6
"""Of the largest value: beside a patch where the factor s is zero, rounding of the position exceeds SINGLE of s."""

POSITION = 1e-4
"""Of the unit square; a single-precision root of a difference of integrals, 6e-8, that grow quadratically."""

RARE = 1e-3
"""Share of values beyond SINGLE beside such patches."""

EXACT = 1e-9
"""Relative; a few float64 operations, and a root of their differences."""

GRAZING = 1e-3
"""cos θ_o below which the half vector of a row loses single precision's digits."""

EDGE_OF_GRID = 1e-6
"""Relative; outermost nodes are looked up 6e-8 inside the grid, as the published code does."""

INTERPOLATED = 0.02
"""Relative; GGX tabulated on 64 nodes a side and 256 for D, then interpolated bilinearly."""

TABULATED = 5e-4
"""Relative; D of GGX between 256 nodes, the only table that a node is interpolated from."""

MEMORY = 10
"""Times the file's size: its bytes, and in float64 directions, values and the warp's tables; 8 and 5 measured."""

PAIRS = 6_000


# --- materials made up ----------------------------------------------------------------------------


class Layout(NamedTuple):
    """What a material file is like: azimuths of incidence and the angle they span, colours, sizes of the grids."""

    azimuths: int = 1
    span: float = 0.0
    wavelengths: tuple[float, ...] = ()
    incidences: int = 5
    grid: int = 12
    fine: tuple[int, int] = (17, 24)


def smooth(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """A sum of a few slow waves over a grid, in [−1, 1]."""
    axes = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    return np.mean([np.cos(rng.uniform(0, 6) + sum(rng.uniform(-4, 4) * axis for axis in axes)) for _ in "abc"], 0)


def material(rng: np.random.Generator, layout: Layout) -> dict[str, np.ndarray]:
    """Fields of a material with realistic ranges; an isotropic one looks the same from the left and at all azimuths.

    (It must for the comparison: Mitsuba turns or mirrors isotropic materials by a number that it never sets.)
    """
    p, t, n, (rows, columns) = layout.azimuths, layout.incidences, layout.grid, layout.fine
    channels, isotropic = len(layout.wavelengths) or 3, p <= 2
    y, x = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    theta, ripple = np.minimum(np.pi / 2 * x**2, 1.5), 0.0 if isotropic else np.cos(4 * np.pi * y)
    vndf = np.exp(smooth(rng, (p, t, rows, columns))) * x * (np.sin(theta) * np.exp(-(theta**2)) + 1e-3)
    vndf[:, t // 2 :, :, -4:] = 0
    vndf[:, :, 3:6, 8:12] = 0
    factor = 0.3 + 0.25 * smooth(rng, (p, t, channels, n, n))
    factor[..., 2:4, 5:8] = 0
    if isotropic:
        vndf, factor = ((table[:1] + table[:1, ..., ::-1, :]).repeat(p, axis=0) / 2 for table in (vndf, factor))
    fields = {
        "phi_i": np.linspace(-np.pi, layout.span - np.pi, p),
        "theta_i": np.linspace(0.03, 1.45, t),
        "ndf": (np.exp(-(np.tan(theta) ** 2) / 0.3) / np.cos(theta) ** 4 + 0.02) * (1 + 0.3 * ripple),
        "sigma": (0.3 + 0.7 * np.cos(theta)) * (1 + 0.1 * ripple),
        "vndf": vndf,
        "luminance": factor.mean(axis=2),
        "spectra" if layout.wavelengths else "rgb": factor,
    }
    fields |= {"wavelengths": np.array(layout.wavelengths)} if layout.wavelengths else {}
    text = np.frombuffer("made up, 25 °C".encode(), np.uint8)
    return {
        "description": text,
        **{name: array.astype(np.float32) for name, array in fields.items()},
        "jacobian": np.ones(1, np.uint8),
    }


def sample(rng: np.random.Generator) -> bytes:
    """A small valid file: RGB or spectral, isotropic or not, with or without a description."""
    azimuths, span = ((1, 0.0), (2, 2 * np.pi), (3, np.pi / 2), (3, np.pi), (4, 2 * np.pi))[rng.integers(5)]
    wavelengths = ((), (550.0,), (360.0, 480.5, 1000.0))[rng.integers(3)]
    fields = material(rng, Layout(azimuths, span, wavelengths, int(rng.integers(1, 4)), 4, (7, 13)))
    fields["description"] = fields["description"][: rng.integers(2) * 99]
    return tensor.packed(fields)


def saved(fields: dict[str, np.ndarray], folder: Path) -> Path:
    tensor.write(folder / "made_up.bsdf", fields)
    return folder / "made_up.bsdf"


# --- against Mitsuba ------------------------------------------------------------------------------

WAVELENGTHS = (360.0, 400.5, 480.0, 555.25, 700.0, 1000.0)
FOUR = (0, 1, 3, 5)
"""Mitsuba evaluates four wavelengths at a time."""

LAYOUTS = {
    "isotropic": Layout(),
    "2 azimuths": Layout(2, 2 * np.pi),
    "mirrored": Layout(5, np.pi / 2),
    "turned": Layout(5, np.pi),
    "all around": Layout(9, 2 * np.pi),
    "one incidence": Layout(incidences=1),
    "sizes of the database": Layout(8, np.pi / 2, incidences=8, grid=32, fine=(128, 128)),
}


def rounded(w: np.ndarray) -> np.ndarray:
    """Directions as single precision has them, of unit length again."""
    single = (w / np.linalg.norm(w, axis=1, keepdims=True)).astype(np.float32).astype(float)
    return single / np.linalg.norm(single, axis=1, keepdims=True)


def pairs(hemisphere: Hemisphere) -> tuple[np.ndarray, np.ndarray]:
    """Directions over the hemisphere, and as many around the mirror direction."""
    wi, wo = hemisphere(PAIRS, 1), hemisphere(PAIRS, 2)
    near = wi * [-1.0, -1.0, 1.0] + 0.15 * (wo - [0.0, 0.0, 0.5])
    return rounded(np.concatenate([wi, wi])), rounded(np.concatenate([wo, near]))


def mitsuba_values(mi: ModuleType, path: Path, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """f_r cos θ_o by the plugin `measured`, three colours or four wavelengths."""
    spectral = "spectral" in mi.variant()
    plugin = mi.load_dict({"type": "measured", "filename": str(path)})
    si, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    if spectral:
        si.wavelengths = [WAVELENGTHS[index] for index in FOUR]
    values = np.empty((len(wi), 4 if spectral else 3))
    for row, (light, sensor) in enumerate(zip(wi.tolist(), wo.tolist(), strict=True)):
        si.wi = light
        values[row] = plugin.eval(context, si, sensor)
    return values


def differences(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    return np.abs(ours - theirs) / (np.abs(theirs) + FLOOR / SINGLE * np.abs(theirs).max())


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral"])
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_evaluation_agrees_with_mitsuba(
    mitsuba: ModuleType, hemisphere: Hemisphere, tmp_path: Path, variant: str, layout: Layout
):
    spectral = variant == "scalar_spectral"
    layout = layout._replace(wavelengths=WAVELENGTHS if spectral else ())
    path = saved(material(np.random.default_rng(5), layout), tmp_path)
    wi, wo = pairs(hemisphere)
    with mitsuba.scoped_set_variant(variant):
        theirs = mitsuba_values(mitsuba, path, wi, wo)
    ours = rgl.material(path).evaluate(wi, wo) * wo[:, 2:]
    ours = ours[:, FOUR] if spectral else ours
    assert np.count_nonzero(theirs) > PAIRS
    assert differences(ours, theirs).max() < SINGLE
    assert np.mean(np.abs(ours - theirs) > SINGLE * np.abs(theirs)) < RARE


def test_without_its_jacobian_the_factor_is_the_value(mitsuba: ModuleType, hemisphere: Hemisphere, tmp_path: Path):
    fields = material(np.random.default_rng(5), LAYOUTS["turned"]) | {"jacobian": np.zeros(1, np.uint8)}
    path = saved(fields, tmp_path)
    wi, wo = (rounded(hemisphere(1000, seed)) for seed in (1, 2))
    ours = rgl.material(path).evaluate(wi, wo) * wo[:, 2:]
    assert differences(ours, mitsuba_values(mitsuba, path, wi, wo)).max() < SINGLE


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_rows_are_what_mitsuba_gives_in_their_directions(mitsuba: ModuleType, tmp_path: Path, layout: Layout):
    """Where a direction has one node: not on the grid's edge (h = n, and φ_h = ±π), where made-up numbers disagree."""
    path = saved(material(np.random.default_rng(8), layout), tmp_path)
    measured, grid = read(path), np.zeros((layout.grid, layout.grid), bool)
    grid[1:-1, 1:-1] = True
    keep = measured.valid.all(axis=1) & (measured.wo[:, 2] > GRAZING)
    keep &= np.tile(grid.reshape(-1), len(keep) // grid.size)
    assert np.count_nonzero(keep) > len(keep) / 8
    wi, wo = measured.wi[keep], measured.wo[keep]
    theirs = mitsuba_values(mitsuba, path, wi, wo)
    assert differences(measured.value[keep] * wo[:, 2:], theirs).max() < SINGLE


def test_warps_are_those_of_mitsuba_in_both_directions(mitsuba: ModuleType):
    rng, shape = np.random.default_rng(2), (3, 4, 9, 14)
    density = np.exp(2 * smooth(rng, shape)).astype(np.float32)
    density[:, :, 2:5, 3:7] = 0
    axes = np.linspace(-1, 1, 3), np.linspace(0, 1.5, 4)
    theirs = mitsuba.MarginalContinuous2D2(density, [axis.tolist() for axis in axes])
    at, position = rng.uniform([-1.2, -0.1], [1.2, 1.6], (2000, 2)), rng.uniform(size=(2000, 2)).astype(np.float32)
    blend = Blend.between(axes[0], at[:, 0]).times(Blend.between(axes[1], at[:, 1]), 4)
    warp = Warp.of(density.reshape(-1, 9, 14))
    for ours, method in ((warp.sample, theirs.sample), (warp.invert, theirs.invert)):
        expected = [method(s, param=p)[0] for s, p in zip(position.tolist(), at.tolist(), strict=True)]
        assert np.abs(ours(position.astype(float), blend) - np.array(expected)).max() < POSITION


def test_sampling_undoes_inversion_where_there_is_density():
    rng = np.random.default_rng(4)
    warp = Warp.of(np.exp(3 * smooth(rng, (2, 20, 33))))
    s = rng.uniform(size=(5000, 2))
    blend = Blend.between(np.array([0.0, 1.0]), rng.uniform(-0.2, 1.2, 5000))
    assert np.abs(warp.invert(warp.sample(s, blend), blend) - s).max() < EXACT


# --- against closed forms -------------------------------------------------------------------------

ALPHA = 0.35


def ggx(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """f_r of Walter et al. 2007 with GGX, separable Smith masking and no Fresnel."""
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    return ggx_d(h[:, 2]) * np.prod([w[:, 2] / ggx_area(w[:, 2]) for w in (wi, wo)], 0) / (4 * wi[:, 2] * wo[:, 2])


def ggx_d(cos: np.ndarray) -> np.ndarray:
    return ALPHA**2 / (np.pi * ((ALPHA**2 - 1) * cos**2 + 1) ** 2)


def ggx_area(cos: np.ndarray) -> np.ndarray:
    """σ(ω) = cos θ / G1."""
    return (cos + np.sqrt(cos**2 + ALPHA**2 * (1 - cos**2))) / 2


@pytest.fixture(scope="module")
def ggx_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """GGX as the paper would store it: D, σ, D_vis, and what remains of f_r cos θ_o."""
    y, x = np.meshgrid(np.linspace(0, 1, 129), np.linspace(0, 1, 128), indexing="ij")
    theta, phi, theta_i = np.pi / 2 * x**2, 2 * np.pi * y - np.pi, np.linspace(0.05, 1.3, 6)[:, None, None]
    facing = np.sin(theta) * np.cos(phi) * np.sin(theta_i) + np.cos(theta) * np.cos(theta_i)
    fine = np.pi / 2 * np.linspace(0, 1, 256) ** 2
    fields = {
        "phi_i": np.zeros(1),
        "theta_i": theta_i[:, 0, 0],
        "ndf": np.tile(ggx_d(np.cos(fine)), (2, 1)),
        "sigma": np.tile(ggx_area(np.cos(fine)), (2, 1)),
        "vndf": (np.maximum(facing, 0) * ggx_d(np.cos(theta)) * 2 * np.pi**2 * x * np.sin(theta))[None],
        "luminance": np.ones((1, 6, 64, 64)),
        "rgb": np.ones((1, 6, 3, 64, 64)),
    }
    fields = {name: array.astype(np.float32) for name, array in fields.items()}
    fields |= {"description": np.zeros(0, np.uint8), "jacobian": np.ones(1, np.uint8)}
    path = saved(fields, tmp_path_factory.mktemp("ggx"))
    cos = np.maximum(rgl.material(path).nodes().wo[:, 2], 0.0)
    masking = (cos / ggx_area(cos)).astype(np.float32).reshape(1, 6, 1, 64, 64)
    fields["rgb"] = masking * np.array([1.0, 0.5, 0.25], np.float32)[:, None, None]
    return saved(fields, path.parent)


def test_a_file_made_from_ggx_is_read_as_ggx(ggx_file: Path):
    """Angles, azimuths, the cosine and the factor 4 are those of the paper; D is interpolated between 256 nodes."""
    measured = read(ggx_file)
    keep = measured.valid.all(axis=1)
    assert np.mean(keep) > 0.5
    expected = ggx(measured.wi[keep], measured.wo[keep])[:, None] * [1.0, 0.5, 0.25]
    assert np.abs(measured.value[keep] / expected - 1).max() < TABULATED


def test_a_file_made_from_ggx_is_evaluated_as_ggx(ggx_file: Path, hemisphere: Hemisphere):
    """At all azimuths, at the incidences of the file, away from grazing angles, where s falls to zero."""
    theta, phi, wo = np.linspace(0.05, 1.3, 6).astype(np.float32), np.arange(3000), hemisphere(3000, 6)
    theta = np.tile(theta.astype(float), 500)
    wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    keep = wo[:, 2] > np.cos(1.3)
    value = rgl.material(ggx_file).evaluate(wi[keep], wo[keep])
    expected = ggx(wi[keep], wo[keep])[:, None] * [1.0, 0.5, 0.25]
    assert np.abs(value / expected - 1).max() < INTERPOLATED


# --- rows, doubts, notes --------------------------------------------------------------------------


@pytest.mark.parametrize("azimuths", [1, 3])
def test_every_number_of_the_file_is_one_value(tmp_path: Path, azimuths: int):
    """Rows in the file's order, phi_i, theta_i, then the grid; f_r cos θ_o 4σ/D is the file's number again."""
    layout = Layout(azimuths, 2 * np.pi, (360.0, 480.5, 1000.0))
    fields = material(np.random.default_rng(6), layout)
    recording = rgl.load(saved(fields, tmp_path))
    spectra = fields["spectra"].transpose(0, 1, 3, 4, 2)
    assert recording.channels == ("360", "480.5", "1000")
    assert recording.value.shape == (spectra.size // 3, 3)
    stored, rows = spectra.reshape(-1, 3), (recording.wo[:, 2] > 0) & (spectra != 0).all(axis=-1).reshape(-1)
    ratio = recording.value[rows] * recording.wo[rows, 2:] / stored[rows]
    assert (np.ptp(ratio, axis=1) < EXACT * ratio.mean(axis=1)).all()
    slices = recording.wi.reshape(azimuths, 5, -1, 3)
    assert (np.ptp(slices, axis=2) == 0).all()
    assert np.allclose(slices[:, :, 0, 2], np.cos(fields["theta_i"].astype(float)), rtol=EXACT)
    assert np.allclose(np.linalg.norm(recording.wo, axis=1), 1.0, rtol=EXACT)


def test_evaluation_gives_the_rows_back(tmp_path: Path):
    path = saved(material(np.random.default_rng(9), Layout(grid=20)), tmp_path)
    measured = read(path)
    keep = measured.valid.all(axis=1)
    back = rgl.material(path).evaluate(measured.wi[keep], measured.wo[keep])
    assert np.abs(back - measured.value[keep]).max() < EDGE_OF_GRID * measured.value[keep].max()


@pytest.mark.parametrize(("azimuths", "span"), [(9, 2 * np.pi), (5, np.pi), (5, np.pi / 2)])
def test_evaluation_gives_rows_at_the_seams_back(tmp_path: Path, azimuths: int, span: float):
    """Numbers that know nothing of each other in every node, so that a slice beyond a seam would be seen.

    −π as the file holds it, in single precision, is an azimuth just below π: light across the seam, at the last slice.
    """
    rng, layout = np.random.default_rng(9), Layout(azimuths, span, grid=14)
    fields = material(rng, layout)
    fields["rgb"] = rng.uniform(0.2, 1.0, fields["rgb"].shape).astype(np.float32)
    fields["vndf"] = rng.uniform(0.5, 1.0, fields["vndf"].shape).astype(np.float32)
    path = saved(fields | {"luminance": fields["rgb"].mean(axis=2)}, tmp_path)
    measured = read(path)
    keep = measured.valid.all(axis=1)
    back = rgl.material(path).evaluate(measured.wi[keep], measured.wo[keep])
    assert np.abs(back / measured.value[keep] - 1.0).max() < 5 * EDGE_OF_GRID
    assert measured.wi[0] == pytest.approx([-np.sin(0.03), 0.0, np.cos(0.03)], abs=1e-6)


def test_a_direction_that_several_nodes_share_counts_once(tmp_path: Path):
    """Of g × g nodes the first row is the mirror direction g times, and the first azimuth is the last one again."""
    path = saved(material(np.random.default_rng(9), Layout(grid=20)), tmp_path)
    measured = read(path)
    keep = measured.valid.any(axis=1)
    for wi in np.unique(measured.wi[keep], axis=0):
        mine = keep & (measured.wi == wi).all(axis=1)
        mirror = np.linalg.norm(measured.wo - wi * [-1, -1, 1], axis=1) < 1e-6
        assert np.count_nonzero(mine & mirror) <= 1
    places = np.round(np.concatenate([measured.wi, measured.wo], axis=1)[keep], 6)
    assert len(np.unique(places, axis=0)) == len(places)
    assert any("in the direction of an earlier one" in reason for reason in measured.masked)


def test_what_cannot_be_a_measurement_is_doubted_with_its_reason(tmp_path: Path):
    fields = material(np.random.default_rng(6), Layout(3, 2 * np.pi, incidences=4))
    fields["luminance"][0, 1, 5, 5] = 0
    fields["vndf"][1, 2] = 0
    fields["sigma"][:, -6:] = 0
    fields["rgb"][0, 0, 0, 5, 2], fields["rgb"][0, 0, 1, 5, 3] = np.nan, np.inf
    path = saved(fields, tmp_path)
    recording = rgl.load(path)
    slices = {reason: doubt.reshape(3, 4, 12, 12, 3) for reason, doubt in recording.doubts.items()}
    grid = fields["luminance"] == 0
    assert grid[0, 1, 5, 5]
    assert (slices["node that the file marks as not measured (luminance 0)"] == grid[..., None]).all()
    empty = slices["incidence at which the file's distribution of visible normals is zero"]
    assert empty[1, 2].all()
    assert np.count_nonzero(empty) == empty[1, 2].size
    unseen = slices["incidence at which the file's projected area sigma is zero"]
    assert unseen[:, -1].all()
    assert not unseen[:, 0].any()
    below = slices["node of the file's grid whose direction is at or below the horizon"]
    assert (below[..., 0].reshape(-1) == (recording.wo[:, 2] <= 1e-6)).all()
    measured = read(path)
    assert measured.masked["value missing or NaN"] == 1
    assert measured.masked["value infinite"] == 1
    assert np.isfinite(measured.value).all()


def test_notes_say_what_the_rows_are(tmp_path: Path):
    fields = material(np.random.default_rng(6), Layout())
    notes = " ".join(read(saved(fields, tmp_path)).notes)
    assert "Described as: made up, 25 °C." in notes
    assert "RGL material, isotropic: 5 incidences with 12×12 nodes each, placed by the warp of Dupuy & Jakob" in notes
    assert "The file holds f_r cos θ_o, its theta_i and phi_i being the light's; divided by cos θ_o." in notes
    fields = material(np.random.default_rng(6), Layout(4, np.pi)) | {
        "description": np.frombuffer(b"\x1b[\n" * 500, "u1")
    }
    notes = read(saved(fields, tmp_path)).notes
    assert any("4 azimuths of incidence: 20 incidences" in note for note in notes)
    assert any(note == f"Described as: {'[ ' * 100}…." for note in notes)


def test_evaluation_is_zero_below_the_surface_and_finite_at_its_edges(tmp_path: Path, singular):
    for layout in LAYOUTS.values():
        made = rgl.material(saved(material(np.random.default_rng(6), layout), tmp_path))
        for wi, wo in singular.values():
            value = made.evaluate(np.atleast_2d(wi), np.atleast_2d(wo))
            assert np.isfinite(value).all()
            assert (value >= 0).all()
        up, down = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, -0.8]])
        assert not made.evaluate(up, down).any()
        assert not made.evaluate(down, up).any()
        assert made.evaluate(up[:0], up[:0]).shape == (0, 3)


def test_wrong_directions_are_refused(tmp_path: Path):
    made = rgl.material(saved(material(np.random.default_rng(6), Layout()), tmp_path))
    up = np.array([[0.0, 0.0, 1.0]] * 2)
    with pytest.raises(ModelError, match=r"shapes \(2, 3\) and \(1, 3\): expected the same"):
        made.evaluate(up, up[:1])
    for length in (1.1, np.nan):
        with pytest.raises(ModelError, match=f"wo row 1 has length {length}: expected unit vectors"):
            made.evaluate(up, up * [[1.0], [length]])


# --- wrong files ----------------------------------------------------------------------------------

GOOD = material(np.random.default_rng(1), Layout(3, np.pi, incidences=2, grid=4))
SPECTRAL = material(np.random.default_rng(1), Layout(1, wavelengths=(400.0, 500.0), incidences=2, grid=4))


def single(*numbers: float) -> np.ndarray:
    return np.array(numbers, np.float32)


WRONG = {
    "another kind": ({"a": single(1)}, "a tensor file without theta_i, phi_i, ndf, sigma, vndf, luminance, rgb, descr"),
    "no rgb": ({k: v for k, v in GOOD.items() if k != "rgb"}, "without rgb, expected a material of the RGL"),
    "no spectra": (GOOD | {"wavelengths": single(550)}, "without spectra, expected a material of the RGL database"),
    "double precision": (GOOD | {"ndf": np.ones((2, 2))}, "ndf is float64 of 2 dimensions, expected float32 of 2"),
    "flat ndf": (GOOD | {"ndf": single(1, 1)}, "ndf is float32 of 1 dimensions, expected float32 of 2"),
    "other incidences": (GOOD | {"theta_i": single(0, 1, 1.5)}, "vndf is 3×2×17×24, expected 3×3×17×24 as the others"),
    "other grid": (GOOD | {"luminance": GOOD["luminance"][..., 1:]}, "rgb is 3×2×3×4×4, expected 3×2×3×4×3"),
    "two colours": (GOOD | {"rgb": GOOD["rgb"][:, :, :2]}, "rgb is 3×2×2×4×4, expected 3×2×3×4×4"),
    "no jacobian": (GOOD | {"jacobian": np.zeros(0, np.uint8)}, "jacobian is 0, expected 1"),
    "one row": (GOOD | {"sigma": np.ones((1, 9), np.float32)}, "sigma is 1×9, expected at least 2×2 nodes"),
    "no incidence": (
        GOOD | {"theta_i": single()} | {name: GOOD[name][:, :0] for name in ("vndf", "luminance", "rgb")},
        "vndf is 3×0×17×24, expected at least 2×2 nodes",
    ),
    "no wavelength": (
        SPECTRAL | {"wavelengths": single(), "spectra": SPECTRAL["spectra"][:, :, :0]},
        "spectra is 1×2×0×4×4, expected at least 2×2 nodes",
    ),
    "NaN in sigma": (
        GOOD | {"sigma": np.full((2, 2), np.nan, np.float32)},
        "sigma holds NaN or infinity, expected num",
    ),
    "infinite vndf": (GOOD | {"vndf": np.full_like(GOOD["vndf"], np.inf)}, "vndf holds NaN or infinity"),
    "negative vndf": (GOOD | {"vndf": -GOOD["vndf"]}, "vndf has negative densities, expected none"),
    "degrees": (GOOD | {"theta_i": single(0, 60)}, "theta_i runs from 0 to 60, expected radians, 0 to π/2"),
    "below the surface": (GOOD | {"theta_i": single(-1, 1)}, "theta_i runs from -1 to 1, expected radians"),
    "a little below the surface": (
        GOOD | {"theta_i": single(-1e-20, 1)},
        "theta_i runs from -1e-20 to 1, expected radians",
    ),
    "same incidence": (GOOD | {"theta_i": single(1, 1)}, "theta_i does not increase, expected radians, 0 to π/2, in"),
    "phi in degrees": (GOOD | {"phi_i": single(-180, -90, 0)}, "phi_i runs from -180 to 0, expected radians"),
    "a third": (GOOD | {"phi_i": single(-1, 0, 1.09)}, "phi_i runs from -57.3 to 62.45 degrees, expected a circle, or"),
    "another half": (GOOD | {"phi_i": single(0, 1, np.pi)}, "phi_i runs from 0 to 180 degrees, expected a circle, or"),
    "micrometres": (SPECTRAL | {"wavelengths": single(0.4, 0.5)}, "wavelengths runs from 0.4 to 0.5, expected nm"),
    "NaN nm": (SPECTRAL | {"wavelengths": single(400, np.nan)}, "wavelengths holds NaN or infinity"),
    "unordered": (SPECTRAL | {"wavelengths": single(500, 400)}, "wavelengths does not increase, expected nm"),
}


@pytest.mark.parametrize(("fields", "message"), WRONG.values(), ids=WRONG)
def test_wrong_materials_are_refused_with_the_reason(tmp_path: Path, fields: dict[str, np.ndarray], message: str):
    path = saved(fields, tmp_path)
    for reading in (read, rgl.load, rgl.material):
        with pytest.raises(ReadError, match=message) as raised:
            reading(path)
        assert str(raised.value).startswith("made_up.bsdf: ")
        assert str(raised.value).isprintable()


def test_a_file_cut_off_is_refused(tmp_path: Path):
    path = saved(GOOD, tmp_path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ReadError, match=r"^made_up\.bsdf: '.*' \(.*\) has bytes .*Was its download cut off\?$"):
        read(path)


def test_damaged_files_are_measurements_or_one_sentence(tmp_path: Path):
    rng, path, refused, number = np.random.default_rng(11), tmp_path / "damaged.bsdf", [], 20 * len(MUTATORS)
    for mutate in 20 * list(MUTATORS.values()):
        path.write_bytes(mutate(sample(rng), rng))
        try:
            measured = read(path)
        except ReadError as error:
            refused.append(str(error))
        else:
            assert isinstance(measured, Measurements)
            assert np.isfinite(measured.value).all()
    assert 0.2 < len(refused) / number < 0.95
    for message in refused:
        assert message.startswith("damaged.bsdf")
        assert message.isprintable()


def test_samples_are_files_that_are_read(tmp_path: Path):
    rng = np.random.default_rng(12)
    for _ in range(20):
        (tmp_path / "x").write_bytes(sample(rng))
        assert read(tmp_path / "x").valid.any()


@pytest.mark.parametrize(
    "layout",
    [
        Layout(4, np.pi / 2, (), incidences=8, grid=32, fine=(96, 96)),
        Layout(1, 0.0, tuple(np.linspace(360.0, 1000.0, 195).tolist()), incidences=4, grid=32, fine=(96, 96)),
    ],
    ids=["RGB", "spectral"],
)
def test_memory_stays_within_a_few_times_the_file(tmp_path: Path, layout: Layout):
    path = saved(material(np.random.default_rng(0), layout), tmp_path)
    tracemalloc.start()
    recording = rgl.load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(recording.value) == layout.azimuths * layout.incidences * 32**2
    assert peak < MEMORY * path.stat().st_size


def test_claims_is_for_tensor_files_alone():
    raw = sample(np.random.default_rng(0))
    assert rgl.claims(raw[:65536], len(raw))
    for other in (b"", b"theta_i,theta_o,brdf\n", b"#Comment\nSource  Measured\n", struct.pack("<3i", 90, 90, 180)):
        assert not rgl.claims(other, len(other))
