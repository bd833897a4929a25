"""Numbers of shaders: what a float of 32 bits is, whatever another library has told NumPy to print."""

import numpy as np
import pytest

from fitmat.models.glsl import number


@pytest.mark.parametrize("options", [{}, {"legacy": "1.13"}, {"precision": 2}])
def test_numbers_are_read_back_as_they_were(options: dict[str, object]) -> None:
    """Shortest digits that tell a float from its neighbours; colour-science, once loaded, prints like NumPy 1.13."""
    rng = np.random.default_rng(0)
    values = rng.normal(size=2000) * 10.0 ** rng.uniform(-30, 30, 2000)
    with np.printoptions(**options):  # pyright: ignore[reportArgumentType]
        texts = [number(value) for value in [*values, 0.0, 0.1, 50.0, 1e-12, np.pi]]
    assert np.array_equal(np.array(texts[:2000], np.float32), values.astype(np.float32))
    assert texts[2000:] == ["0.0", "0.1", "50.0", "1e-12", "3.1415927"]
    assert all("." in text or "e" in text for text in texts)
