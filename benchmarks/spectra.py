"""How long fits of spectra take: one band, RGB, and up to a thousand bands of one measurement.

Example:
    python benchmarks/spectra.py --bands 1 3 31
"""

import argparse
import resource
import time

import jax
import machine
import numpy as np

import fitmat as fm

ROWS = 500


def measured(bands: int) -> fm.Measurements:
    """A plastic whose colour is a band of light, five incidences, with noise that is told."""
    nm, rng = np.linspace(400.0, 700.0, bands), np.random.default_rng(0)
    kd = 0.2 + 0.3 * np.exp(-(((nm - 600.0) / 60.0) ** 2))
    truth = fm.model("lambert+ggx", channels=bands, kd=kd, alpha=0.2, eta=1.5)
    theta_i = np.repeat(np.deg2rad([10.0, 30.0, 45.0, 60.0, 70.0]), ROWS // 5)
    theta_o = np.tile(np.deg2rad(np.linspace(-80.0, 80.0, ROWS // 5)), 5)
    empty = fm.from_arrays(theta_i, theta_o, np.ones((ROWS, bands)))
    value = fm.evaluate(truth, empty.wi, empty.wo)
    sigma = 0.02 * value + 1e-3
    noisy = value + sigma * rng.standard_normal(value.shape)
    return fm.from_arrays(theta_i, theta_o, noisy, sigma=sigma, channels=[f"{x:g}" for x in nm])


def main() -> None:
    """Time each twice or more, programs at hand, and print the least seconds of CPU."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--bands", type=int, nargs="+", default=[1, 3, 31, 100, 1000])
    options.add_argument("--repeats", type=int, default=4)
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    for bands in chosen.bands:
        m = measured(bands)
        fm.fit(m, "lambert+ggx").covariance  # noqa: B018, which compiles
        fits, intervals = [], []
        for _ in range(chosen.repeats):
            begin = time.process_time()
            found = fm.fit(m, "lambert+ggx")
            fits.append(time.process_time() - begin)
            begin = time.process_time()
            found.covariance  # noqa: B018
            intervals.append(time.process_time() - begin)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{bands:5} bands: fit {min(fits):.3f} s, intervals {min(intervals):.3f} s of CPU, at most {peak:.0f} MB")


if __name__ == "__main__":
    main()
