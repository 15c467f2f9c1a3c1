"""People are told the numbers that they see beside their curves, also where some were removed before."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracemesh.errors import PiecesError, ScanError
from tracemesh.geometry.scan import curve_name
from tracemesh.jobs.numbering import numbered, renumbered


@given(st.lists(st.integers(0, 200), max_size=30, unique=True), st.data())
def test_every_curve_that_is_named_gets_its_own_number(indices: list[int], data: st.DataObject) -> None:
    named = data.draw(st.lists(st.integers(0, len(indices) - 1), max_size=5)) if indices else []
    said = "segment 1-2 of " + ", curves cross: ".join(f"{curve_name(place)}; 3 mm" for place in named)
    wanted = "segment 1-2 of " + ", curves cross: ".join(f"{curve_name(indices[place])}; 3 mm" for place in named)
    assert renumbered(said, indices) == wanted


def test_an_error_keeps_its_kind_and_what_it_is_about() -> None:
    with pytest.raises(PiecesError, match=r"^curve 4 hangs on nothing, curve 10 does$") as caught, numbered([3, 9]):
        raise PiecesError("curve 1 hangs on nothing, curve 2 does", (0,), "nodes")
    assert (caught.value.curves, caught.value.mend) == ((0,), "nodes")
    with pytest.raises(ScanError, match="curve 3"), numbered([3, 9]):
        raise ScanError("curve 3 is none of these")
