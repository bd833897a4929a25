"""Finer pixels: radiances between the pixels of a screen, for what depends on how many pixels show it.

A mean converges fast with the rule of `scene`; a quantile counts pixels. No model is evaluated here.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.match.appearance import scene
from fitmat.match.appearance.scene import Screen

PARTS = (6, 4)
"""Into so many rings, and so many pixels along them, each pixel is divided."""


def divided(
    screen: Screen, values: Float[np.ndarray, "m k"]
) -> tuple[Float[np.ndarray, "n k"], Float[np.ndarray, " n"]]:
    """Each pixel as `PARTS` of alike area, with the values there by linear interpolation.

    Beyond the innermost ring lies the mean of its pixels, beyond a meridian the other side of the ring; where a ring
    ends because light or viewer do not reach further, and at the rim, values go on in a straight line.

    Args:
        screen: m pixels.
        values: There, in their order.

    Returns:
        Values of n = 24 m parts, and their area on the screen.
    """
    grid = values.reshape(*screen.area.shape, -1)
    middle = np.broadcast_to(grid[:1].mean(axis=(1, 2), keepdims=True), grid[:1].shape)
    partly = scene.reach(screen.rings, screen.half) < np.pi / 2.0 - 1e-9
    grid = _ended(np.concatenate([middle, grid, 2.0 * grid[-1:] - grid[-2:-1]]), partly[[0, *range(len(partly)), -1]])
    for axis, parts in ((0, PARTS[0]), (2, PARTS[1])):
        grid = _between(grid, axis, parts)
    area = screen.area.repeat(PARTS[0], axis=0).repeat(PARTS[1], axis=2) / np.prod(PARTS)
    return grid.reshape(-1, values.shape[1]), area.ravel()


def halved(screen: Screen, values: Float[np.ndarray, "m k"]) -> tuple[Screen, Float[np.ndarray, "h k"]]:
    """Half as many rings, each with the area and the mean of two; of an odd number the last is left out."""
    count = len(screen.rings) // 2 * 2
    grid = values.reshape(*screen.area.shape, -1)[:count]
    area = screen.area[:count].reshape(count // 2, 2, *screen.area.shape[1:])
    rings = screen.rings[:count].reshape(-1, 2).mean(axis=1)
    means = grid.reshape(count // 2, 2, *grid.shape[1:]).mean(axis=1)
    return dataclasses.replace(screen, rings=rings, area=area.sum(axis=1)), means.reshape(-1, values.shape[1])


def _ended(grid: Float[np.ndarray, "a s b k"], partly: np.ndarray) -> Float[np.ndarray, "a s c k"]:
    """Rings with one pixel more at either end: of the other side, or, of rings that are partly seen, straight on."""
    first, last = grid[:, ::-1, :1], grid[:, ::-1, -1:]
    ends = (2.0 * grid[:, :, :1] - grid[:, :, 1:2], 2.0 * grid[:, :, -1:] - grid[:, :, -2:-1])
    ended = partly[:, None, None, None]
    return np.concatenate([np.where(ended, ends[0], first), grid, np.where(ended, ends[1], last)], axis=2)


def _between(grid: np.ndarray, axis: int, parts: int) -> np.ndarray:
    """Values at the middles of parts of the pixels along an axis, whose first and last entries lie beyond it."""
    count = grid.shape[axis] - 2
    at = (1.0 + np.arange(count)[:, None] + (np.arange(parts) + 0.5) / parts - 0.5).ravel()
    below = np.floor(at).astype(int)
    shape = [-1 if k == axis else 1 for k in range(grid.ndim)]
    ahead = (at - below).reshape(shape)
    return grid.take(below, axis) * (1.0 - ahead) + grid.take(below + 1, axis) * ahead
