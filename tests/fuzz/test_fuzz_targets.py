"""The fuzzed laws on the corpus and on what hypothesis makes of it; `python -m tests.fuzz` goes further."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.targets import TARGETS

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*/*"))


@pytest.mark.parametrize("path", CORPUS, ids=lambda p: f"{p.parent.name}-{p.name}")
def test_the_corpus_breaks_no_law(path: Path) -> None:
    TARGETS[path.parent.name](path.read_bytes())


def test_every_target_has_a_corpus() -> None:
    assert {path.parent.name for path in CORPUS} == set(TARGETS)


@st.composite
def damaged(draw: st.DrawFn, name: str) -> bytes:
    """A file of the corpus with a few places replaced, cut out or doubled."""
    data = draw(st.sampled_from([p for p in CORPUS if p.parent.name == name])).read_bytes()
    for _ in range(draw(st.integers(1, 4))):
        start, length = draw(st.integers(0, len(data))), draw(st.integers(0, 12))
        junk = draw(st.one_of(st.binary(max_size=6), st.sampled_from([b"1e999", b"-1", b"\n", b'"', b"NaN", b"0"])))
        kept = draw(st.sampled_from([b"", data[start : start + length]]))
        data = data[:start] + junk + kept + data[start + length :]
    return data


@pytest.mark.parametrize("name", TARGETS)
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_damage_breaks_no_law(name: str, data: st.DataObject) -> None:
    TARGETS[name](data.draw(damaged(name)))


@pytest.mark.parametrize("name", TARGETS)
@settings(max_examples=50, deadline=None)
@given(data=st.binary(max_size=100))
def test_any_bytes_break_no_law(name: str, data: bytes) -> None:
    TARGETS[name](data)
