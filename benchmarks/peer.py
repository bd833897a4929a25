"""The peer: Lambert + GGX, the likelihood and its coordinates in plain vectorised numpy, as careful users write them.

The model is a function of two directions, as fitmat's is; with `hoisted`, what no parameter changes (half vectors,
cosines) is taken out of the loop by hand. Uses no JAX and nothing of fitmat but the numbers of the data.
"""

import numpy as np

LOWER = np.array([0.0, 0.0, 1e-4, 1.0])
UPPER = np.array([1.0, 10.0, 1.0, 50.0])
LOG = np.array([False, False, True, True])
"""Bounds and scale of kd, ks, alpha, eta, as in fitmat."""

LOW, HIGH = (np.append(edge[:2], np.log(edge[2:])) for edge in (LOWER, UPPER))
COEFFICIENTS = [3.0 / (2 * k + 3) * (-1.0) ** k for k in range(12)]


def from_sine(u: np.ndarray) -> np.ndarray:
    """The unbounded coordinates that the solver sees → kd, ks, alpha, eta (James & Roos 1975)."""
    return physical(LOW + (HIGH - LOW) * (1.0 + np.sin(u)) / 2.0)


def physical(t: np.ndarray) -> np.ndarray:
    """Logarithms of alpha and eta → alpha and eta; (..., 4)."""
    return np.concatenate([t[..., :2], np.exp(t[..., 2:])], axis=-1)


class Problem:
    """The samples and everything about them that no parameter changes.

    Args:
        wi: Unit vectors to the light, (n, 3).
        wo: Unit vectors to the sensor, (n, 3).
        value: Measured BRDF in sr⁻¹, (n,).
        sigma: Its standard deviation, (n,).
        hoisted: Compute half vectors and cosines once, not with every evaluation of the model.
    """

    def __init__(
        self, wi: np.ndarray, wo: np.ndarray, value: np.ndarray, sigma: np.ndarray, *, hoisted: bool = True
    ) -> None:
        self.directions, self.hoisted = (wi, wo), hoisted
        self.geometry()
        self.x, self.noise = value * self.ci, sigma * self.ci
        self.root2 = np.cbrt(self.x) ** 2
        self.constant = -np.sum(0.5 * np.log(2 * np.pi) - np.log(self.ci))

    def geometry(self) -> None:
        """Half vectors and cosines of all pairs."""
        wi, wo = self.directions
        h = wi + wo
        h = h / np.linalg.norm(h, axis=1, keepdims=True)
        self.ci, self.co = wi[:, 2].copy(), wo[:, 2].copy()
        self.ci2, self.co2, self.ch2 = self.ci**2, self.co**2, h[:, 2] ** 2
        self.si2, self.so2, self.sh2 = 1.0 - self.ci2, 1.0 - self.co2, h[:, 0] ** 2 + h[:, 1] ** 2
        self.cd = np.sum(wi * h, axis=1)
        self.cd2, self.cico = self.cd**2, self.ci * self.co

    def predicted(self, p: np.ndarray) -> np.ndarray:
        """f cosθ_i for kd, ks, alpha, eta: (4,) → (n,), (w, 4) → (w, n)."""
        if not self.hoisted:
            self.geometry()
        kd, ks, alpha, eta = p if p.ndim == 1 else p.T[:, :, None]
        alpha2, c = alpha**2, self.cd
        g = np.sqrt(eta**2 - 1.0 + self.cd2)
        fresnel = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
        density = alpha2 / (np.pi * (alpha2 * self.ch2 + self.sh2) ** 2)
        ai = 0.5 * (self.ci + np.sqrt(self.ci2 + alpha2 * self.si2))
        ao = 0.5 * (self.co + np.sqrt(self.co2 + alpha2 * self.so2))
        visibility = 1.0 / (ai * self.co + ao * self.ci - self.cico)
        return (kd / np.pi + ks * fresnel * density * visibility / 4.0) * self.ci

    def residuals(self, p: np.ndarray, measured: np.ndarray, s: float) -> np.ndarray:
        """z(y κ) − z(f κ) for a fixed discrepancy s, (n,); `measured` is z(y κ), computed once."""
        return measured - self.stabilised(self.predicted(p), s)

    def stabilised(self, x: np.ndarray, s: float | np.ndarray, root2: np.ndarray | None = None) -> np.ndarray:
        """The transform z(x) = (x/a) · 3(q − atan q)/q³, q² = 3 s |x|^(2/3)/a; `root2` is |x|^(2/3) if known."""
        q2 = 3.0 * s * (np.cbrt(x) ** 2 if root2 is None else root2) / self.noise
        small = q2 < 0.05
        q = np.sqrt(q2)
        with np.errstate(divide="ignore", invalid="ignore"):
            shape = 3.0 * (q - np.arctan(q)) / (q * q2)
        if small.any():
            shape[small] = np.polynomial.polynomial.polyval(q2[small], COEFFICIENTS)
        return x / self.noise * shape

    def log_posterior(self, t: np.ndarray) -> np.ndarray | float:
        """Log posterior of kd, ks, ln alpha, ln eta, s, flat prior within the bounds: (5,) → (), (w, 5) → (w,)."""
        inside = np.all((t[..., :4] >= LOW) & (t[..., :4] <= HIGH), axis=-1) & (t[..., 4] >= 0)
        if t.ndim == 1 and not inside:
            return -np.inf
        s = np.abs(t[..., 4:]) if t.ndim == 2 else t[4]
        p = physical(np.where(inside[..., None], t[..., :4], LOW)) if t.ndim == 2 else physical(t[:4])
        r = self.stabilised(self.x, s, self.root2) - self.stabilised(self.predicted(p), s)
        spread = np.log(self.noise + 3.0 * s * self.root2)
        found = self.constant - np.sum(0.5 * r**2 + spread, axis=-1)
        return np.where(inside, found, -np.inf) if t.ndim == 2 else found
