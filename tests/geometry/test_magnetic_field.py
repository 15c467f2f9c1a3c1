"""The field of a place agrees with the model's published values; a device at rest measures the same in any pose."""

from datetime import date

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracemesh.errors import InputError, ScanError
from tracemesh.geometry.sensing.magnetic_field import field_at, field_at_rest
from tracemesh.geometry.sensing.orientation import ReferenceField, frames_from_vectors


def inclination(field: ReferenceField) -> float:
    return float(np.degrees(field.angle) - 90)


@pytest.mark.parametrize(
    ("on", "kilometres", "latitude", "longitude", "published"),
    [  # the test values that come with WMM2020
        (date(2020, 1, 1), 66, 14, 143, 13.08),
        (date(2020, 1, 1), 18, 0, 21, -26.46),
        (date(2020, 7, 2), 6, -36, -137, -52.21),
        (date(2020, 7, 2), 63, 26, 81, 40.84),
    ],
)
def test_inclinations_are_those_that_the_model_publishes(
    on: date, kilometres: float, latitude: float, longitude: float, published: float
) -> None:
    assert inclination(field_at(latitude, longitude, on, 1000 * kilometres)) == pytest.approx(published, abs=0.006)


@given(latitude=st.floats(-60, 60), longitude=st.floats(-180, 180), year=st.sampled_from([2020, 2025]))
def test_successive_models_agree_where_one_follows_the_other(latitude: float, longitude: float, year: int) -> None:
    before, after = (field_at(latitude, longitude, on) for on in (date(year - 1, 12, 31), date(year, 1, 1)))
    assert inclination(before) == pytest.approx(inclination(after), abs=0.6)
    assert before.magnetic[0] == after.magnetic[0] == 0.0
    assert before.magnetic[1] > 0


@pytest.mark.parametrize(
    ("latitude", "longitude", "on", "words"),
    [
        (91, 0, date(2026, 1, 1), "latitude from -90 to 90.*got 91"),
        (float("nan"), 0, date(2026, 1, 1), "latitude"),
        (45, 181, date(2026, 1, 1), "longitude"),
        (45, 6, date(2014, 12, 31), "2015 to 2029, got 2014-12-31"),
        (45, 6, date(2030, 1, 1), "2015 to 2029"),
        (86, 140, date(2026, 1, 1), "too steep"),
    ],
)
def test_what_has_no_field_is_refused(latitude: float, longitude: float, on: date, words: str) -> None:
    with pytest.raises(InputError, match=words):
        field_at(latitude, longitude, on)


@given(degrees=st.floats(-60, 60), seed=st.integers(0, 1000), units=st.floats(1e-3, 1e3))
def test_a_device_at_rest_measures_the_inclination_in_any_pose(degrees: float, seed: int, units: float) -> None:
    true = ReferenceField.from_inclination(np.radians(degrees))
    pose, rng = Rotation.random(rng=seed), np.random.default_rng(seed)
    up, field = (
        np.tile(pose.inv().apply(v), (400, 1)) + rng.normal(0, 0.005, (400, 3))
        for v in (true.acceleration, true.magnetic)
    )
    measured = field_at_rest(units * up, field)
    assert inclination(measured) == pytest.approx(degrees, abs=0.15)
    frames = frames_from_vectors(up, field, measured)
    assert np.degrees((Rotation.from_matrix(frames) * pose.inv()).magnitude()).mean() < 1.0


def test_a_wrong_inclination_turns_everything_alike_by_half_of_it_about_east() -> None:
    true, wrong = (ReferenceField.from_inclination(np.radians(i)) for i in (61.0, 51.0))
    poses = Rotation.random(20, rng=3)
    vectors = [poses.inv().apply(v) for v in (true.acceleration, true.magnetic)]
    turned = Rotation.from_matrix(frames_from_vectors(*vectors, wrong)) * poses.inv()
    np.testing.assert_allclose(np.abs(turned.as_rotvec(degrees=True)), np.tile([5.0, 0.0, 0.0], (20, 1)), atol=1e-9)


def test_a_device_that_moves_is_not_at_rest() -> None:
    up = Rotation.from_euler("x", np.linspace(0, 10, 50)[:, None], degrees=True).apply([0.0, 0.0, 1.0])
    with pytest.raises(ScanError, match=r"at rest.*acceleration.*5 degrees.*sample 1"):
        field_at_rest(up, np.tile([0.0, 1.0, -1.0], (50, 1)))
    with pytest.raises(ScanError, match="magnetic field: sample 3 "):
        field_at_rest(np.tile(up[:1], (5, 1)), np.array([[0.0, 1.0, -1.0]] * 2 + [[0.0, 0.0, 0.0]] * 3))
