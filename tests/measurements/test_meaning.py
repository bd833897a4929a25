"""A table whose numbers mean something else is read as it was meant, refused, or warned about."""

from collections import Counter

import meaning
import pytest


def misread(counts: dict[str, Counter[str]]) -> dict[str, int]:
    return {kind: found["misread"] for kind, found in counts.items() if found["misread"]}


def test_changes_of_meaning_are_not_read_in_silence() -> None:
    counts = meaning.tried(2 * len(meaning.KINDS), seed=1)
    assert misread(counts) == {}


@pytest.mark.study
def test_two_thousand_changes_of_meaning_are_not_read_in_silence() -> None:
    counts = meaning.tried(2000, seed=0)
    assert misread(counts) == {}
    assert sum(found["right"] for found in counts.values()) > 800  # of two dozen kinds half can be read without a flag


def test_a_table_that_is_misread_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Values of 90 % of what they were, which nobody can see."""

    def fainter(t: meaning.Table, rng: object) -> None:
        t.written[t.quantity] = [f"{0.9 * x:.5g}" for x in meaning.numbers(t)]

    monkeypatch.setattr(meaning, "KINDS", (fainter,))
    assert misread(meaning.tried(3, seed=0)) == {"fainter": 3}
