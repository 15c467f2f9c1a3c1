import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracemesh_bridge.keys import Discard, EndCurve, Help, KeyParser, MarkNode, Quit, StartCurve, Undo, Unknown


@pytest.mark.parametrize(
    ("typed", "commands"),
    [
        ("-", [StartCurve(boundary=True)]),
        ("+", [StartCurve(boundary=False)]),
        ("7\n", [MarkNode(7)]),
        ("12\r", [MarkNode(12)]),
        ("1/2\n", [MarkNode(2)]),
        ("1\x7f\x7f", [Undo()]),
        ("u", [Undo()]),
        ("1-2\n", [StartCurve(boundary=True), MarkNode(2)]),
        (".*c", [EndCurve(closed=False), EndCurve(closed=True), EndCurve(closed=True)]),
        ("x\nq\n?\n", [Discard(), Quit(), Help()]),
        ("\n\r\n  \t", []),
        ("y", [Unknown("y")]),
        ("1234567\n", [Unknown("7")]),
    ],
)
def test_grammar(typed, commands):
    assert list(KeyParser().feed(typed)) == commands


@given(st.lists(st.sampled_from(["-", "+", ".", "*", "3", "14", "/"])))
def test_line_by_line_means_the_same_as_key_by_key(lines):
    numbers = [f"{line}\n" if line.isdigit() else line for line in lines]
    assert list(KeyParser().feed("".join(f"{line}\n" for line in lines))) == list(KeyParser().feed("".join(numbers)))


@given(st.text(), st.integers(0, 20))
def test_any_text_in_any_pieces(text, cut):
    parser = KeyParser()
    assert [*parser.feed(text[:cut]), *parser.feed(text[cut:])] == list(KeyParser().feed(text))
