"""Parts of a number of things: even, whole and in order."""

from fitmat.maths.parts import slices


def test_parts_are_even_and_complete() -> None:
    assert [(s.start, s.stop) for s in slices(17, 16)] == [(0, 8), (8, 17)]
    assert [(s.start, s.stop) for s in slices(16, 16)] == [(0, 16)]
    assert not list(slices(0, 16))
