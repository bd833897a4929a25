"""Gaps: what a grid, the table's or the format's, holds and nobody measured; what is complete, or none, is refused."""

import dataclasses
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.measurements import writing
from fitmat.measurements.formats import merl
from fitmat.measurements.gaps import gaps


def grid(turn: float = 0.0) -> fm.Measurements:
    """Three incidences × five θ_o × three azimuths, degrees."""
    i, o, phi = (part.ravel() for part in np.meshgrid([5, 20, 50], [0, 10, 30, 60, 75], [0, 90, 180], indexing="ij"))
    angles = (np.deg2rad(part) for part in (i, o, phi))
    theta_i, theta_o, azimuth = angles
    return fm.from_arrays(theta_i, theta_o, 0.1 + 0.01 * np.arange(len(i)), phi=azimuth, phi_i=turn)


def test_what_was_inferred_is_not_read_as_measured() -> None:
    """A fit to it would find the model that filled it."""
    table = {"theta_i": [5, 5, 20], "theta_o": [10, 20, 30], "brdf": [0.1, 0.2, 0.3], "inferred": [0, 1, 0]}
    found = fm.read(table)
    assert found.valid[:, 0].tolist() == [True, False, True]
    assert found.masked == {"inferred, not measured": 1}
    assert not any("not used" in note for note in found.notes)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_holes_of_a_grid_are_its_missing_directions(turn: float) -> None:
    whole = grid(turn)
    gone = np.array([4, 20, 21, 40])
    found = gaps(whole.rows(np.delete(np.arange(whole.n_samples), gone)))
    meant = np.concatenate([whole.wi[gone], whole.wo[gone]], axis=1)
    assert np.sort(np.concatenate(found, axis=1).round(9), axis=0) == pytest.approx(
        np.sort(meant.round(9), axis=0), abs=1e-9
    )


def test_one_incidence_too_few_is_completed_at_the_directions_of_the_others() -> None:
    whole = grid()
    left = whole.rows(np.flatnonzero((whole.theta_i < 0.5) | (whole.in_plane)))
    wi, wo = gaps(left)
    assert len(wi) == 4  # at 50° incidence: four θ_o beside the normal, at 90°
    assert np.rad2deg(np.arccos(wi[:, 2])) == pytest.approx(np.full(4, 50.0))
    assert np.abs(wo[:, 0]).max() < 1e-9


def test_what_is_complete_or_no_grid_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FitmatError, match=r"array: nothing to complete: every direction of its grid was measured"):
        gaps(grid())
    rng = np.random.default_rng(0)
    light, sensor = rng.uniform(0.0, 1.4, (2, 200))
    odd = fm.from_arrays(light, sensor, np.ones(200), phi=rng.uniform(0.0, 3.0, 200))
    with pytest.raises(FitmatError, match=r"200 directions of light and 200 of the sensor form no grid"):
        gaps(odd)
    wi, wo = merl.centres()
    above = np.flatnonzero((wi[:, 2] > 0) & (wo[:, 2] > 0))
    full = fm.Measurements(wi[above], wo[above], np.ones((len(above), 1)), None, np.ones((len(above), 1), bool), ("v",))
    with pytest.raises(FitmatError, match=r"nothing to complete: every MERL cell is filled"):
        writing.gaps(full, tmp_path / "a.binary")
    two = fm.from_arrays(0.1, [0.1, 0.2], np.ones((2, 2)))
    with pytest.raises(FitmatError, match=r"MERL files hold r, g and b, got 2 channels, expected 1 or 3"):
        writing.gaps(two, tmp_path / "a.binary")
    (tmp_path / "a.cells.parquet").touch()
    with pytest.raises(FitmatError, match=r"a\.cells\.parquet: already exists; choose another name, or --force"):
        writing.gaps(two, tmp_path / "a.binary")


def test_tables_mark_what_was_inferred_and_other_formats_have_it_beside_them(tmp_path: Path) -> None:
    whole = grid()
    marked = fm.Measurements(
        whole.wi, whole.wo, whole.value, 0.01 * whole.value, whole.valid, whole.channels,
        inferred=(np.arange(whole.n_samples) % 2 == 1)[:, None],
    )  # fmt: skip
    with pytest.warns(UserWarning, match="sigma not written"):
        fm.write(marked, tmp_path / "a.binary")
    fm.write(marked, tmp_path / "a.csv")
    for table in (pl.read_parquet(tmp_path / "a.cells.parquet"), pl.read_csv(tmp_path / "a.csv", null_values="nan")):
        assert table["inferred"].to_list() == [0.0, 1.0] * 22 + [0.0]
        for name, rows in (("sigma", slice(None, None, 2)), ("inferred_sd", slice(1, None, 2))):
            assert table[name].to_numpy()[rows] == pytest.approx(0.01 * whole.value[rows, 0], rel=1e-6)
    back = fm.read(tmp_path / "a.cells.parquet")
    assert (back.value[::2] == whole.value[::2]).all()
    assert back.valid[:, 0].tolist() == [True, False] * 22 + [True]
    assert not (tmp_path / "a.csv.cells.parquet").exists()
    before = (tmp_path / "a.binary").read_bytes()
    for name in ("a.alta", "a.binary"):
        with pytest.raises(FitmatError, match=r"a\.cells\.parquet says that values of a\.\w+ were inferred, which th"):
            fm.write(whole, tmp_path / name, force=True)
    assert (tmp_path / "a.binary").read_bytes() == before


@pytest.mark.parametrize("names", [("r", "g"), ("front", "back")])
@pytest.mark.parametrize("given", [True, False])
def test_what_was_measured_beside_what_was_inferred_is_read_again(
    names: tuple[str, str], given: bool, tmp_path: Path
) -> None:
    """A row of which one channel was inferred keeps the other, and a noise that nobody gave is not read as given."""
    whole = grid()
    value = whole.value * [1.0, 0.5]
    inferred = np.zeros(value.shape, bool)
    inferred[3, 1] = inferred[7] = True
    sigma = np.where(inferred | given, 0.01 * value, np.nan)
    marked = fm.Measurements(whole.wi, whole.wo, value, sigma, np.ones_like(inferred), names, inferred=inferred)
    assert marked.sigma_given == given
    for name in ("a.csv", "a.parquet"):
        back = fm.read(fm.write(marked, tmp_path / name))
        assert back.channels == names
        assert (back.valid == ~inferred).all()
        assert back.value[~inferred] == pytest.approx(value[~inferred], rel=1e-6)
        assert back.masked == {"inferred, not measured": 2}
        assert not any("not used" in said for said in (*back.notes, *back.warnings))
        assert (back.sigma is not None) == given
        assert back.sigma is None or back.sigma[~inferred] == pytest.approx(sigma[~inferred], rel=1e-6)


def test_what_completes_measurements_is_not_fitted() -> None:
    """In memory as from a file; in a second completion it is inferred anew."""
    whole = grid()
    m = fm.from_arrays(whole.theta_i, whole.theta_o, np.full((whole.n_samples, 1), 0.1), phi=whole.phi)
    odd = (np.arange(m.n_samples) % 3 == 1)[:, None]
    filled = dataclasses.replace(m, value=np.where(odd, 0.5, 0.1), inferred=odd, sigma=np.where(odd, 0.01, np.nan))
    found = fm.fit(filled, "lambert")
    assert found.values == pytest.approx([0.1 * np.pi], rel=1e-6)
    assert (found.measurements.n_valid, found.measurements.sigma) == (30, None)
    assert found.measurements.masked == {"inferred, not measured": 15}
    assert fm.examine(filled).measurements.n_valid == 30
    again = fm.laplace(found, seed=0).complete(m.wi[1:2], m.wo[1:2], filled)
    assert again.n_samples == 31
    assert again.value[-1, 0] == pytest.approx(0.1, rel=1e-3)


def test_measured_cells_of_a_merl_file_are_those_without_completion() -> None:
    """Bit for bit; every other cell above the horizon holds what was inferred, and none below."""
    whole = grid()
    three = fm.from_arrays(
        whole.theta_i, whole.theta_o, whole.value * [1.0, 0.7, 0.3], phi=whole.phi, channels=["r", "g", "b"]
    )
    wi, wo = merl.gaps(three)
    value, valid = (np.concatenate([part, np.full((len(wi), 3), fill)]) for part, fill in
                    ((three.value, 0.123), (three.valid, True)))  # fmt: skip
    pairs = np.concatenate([three.wi, wi]), np.concatenate([three.wo, wo])
    planes, before = (
        np.frombuffer(merl.dump(m), "<f8", offset=12).reshape(3, -1)
        for m in (fm.Measurements(*pairs, value, None, valid, three.channels), three)
    )
    measured = before[0] >= 0
    assert 30 < measured.sum() <= three.n_samples
    assert (planes[:, measured] == before[:, measured]).all()
    above = np.minimum(*(w[:, 2] for w in merl.centres())) > 1e-6
    assert ((planes[0] >= 0) == (above | measured)).all()
    assert planes[0][above & ~measured] == pytest.approx(0.123 * 1500.0)


def test_a_full_disk_leaves_neither_file(tmp_path: Path) -> None:
    """As by a limit of the size of files."""
    resource = pytest.importorskip("resource", reason="no limits on this system")
    whole = grid()
    marked = fm.Measurements(
        whole.wi, whole.wo, whole.value, None, whole.valid, whole.channels, inferred=np.ones(whole.value.shape, bool)
    )
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, limits[1]))
    try:
        with pytest.raises(FitmatError, match=r"a\.cells\.parquet: cannot be written \(File too large\); choose"):
            fm.write(marked, tmp_path / "a.alta")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
