"""Parts: a number of things cut evenly, so that what is worked out of some at a time fits into memory.

It knows nothing of what they are.
"""

from collections.abc import Iterator


def slices(count: int, most: int) -> Iterator[slice]:
    """Even parts of a number of things, each of at most so many.

    Example:
        >>> list(slices(17, 16))
        [slice(0, 8, None), slice(8, 17, None)]
    """
    parts = -(-count // most)
    return (slice(k * count // parts, (k + 1) * count // parts) for k in range(parts))
