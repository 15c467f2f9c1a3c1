"""A device with any distortion is recovered from its own readings; what it did not see is named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracemesh.errors import ScanError
from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.sensing.calibration import fit_calibration, wheel_circumference
from tracemesh.geometry.sensing.calibration_alignment import alignment, at_rest, face_rotation
from tracemesh.geometry.sensing.calibration_coverage import DIRECTIONS, NAMES, coverage
from tracemesh.geometry.sensing.calibration_ellipsoid import fit_sensor
from tracemesh.geometry.sensing.orientation import angles_between

Floats = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def field(dip: float = 60.0) -> Floats:
    return np.array([0.0, np.cos(np.radians(dip)), -np.sin(np.radians(dip))])


def soft_iron(seed: int, strength: float) -> Floats:
    """What a sensor makes of the truth: a symmetric matrix with scales in 1 ± strength."""
    random = np.random.default_rng(seed)
    axes = Rotation.random(rng=random).as_matrix()
    return np.asarray(axes @ np.diag(random.uniform(1 - strength, 1 + strength, 3)) @ axes.T)


def readings(vector: Floats, poses: Rotation, distortion: Floats, offset: Floats, noise: float = 0.0) -> Floats:
    """What a sensor says: m = D A^T e + h, and noise."""
    random = np.random.default_rng(5)
    true = poses.inv().apply(vector)
    return np.asarray(true @ distortion.T + offset + noise * random.standard_normal(true.shape))


def poses(count: int = 400, seed: int = 1) -> Rotation:
    return Rotation.random(count, rng=np.random.default_rng(seed))


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    strength=st.floats(0.0, 0.5),
    offset=st.tuples(*[st.floats(-3, 3)] * 3),
    unit=st.floats(0.01, 1000),
)
def test_any_hard_and_soft_iron_is_recovered_exactly(
    seed: int, strength: float, offset: tuple[float, ...], unit: float
) -> None:
    distortion, hard = unit * soft_iron(seed, strength), unit * np.array(offset)
    fit = fit_sensor(readings(field(), poses(seed=seed), distortion, hard), "magnetometer")
    exact = np.linalg.inv(distortion)
    np.testing.assert_allclose(fit.correction.matrix, exact / np.cbrt(np.linalg.det(exact)), atol=1e-7)
    np.testing.assert_allclose(fit.correction.offset, hard, atol=1e-7 * unit)
    assert fit.spread_after < 1e-7
    assert fit.coverage.fraction == 1.0


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    dip=st.floats(-70, 70),
    turn=st.tuples(*[st.floats(-1.5, 1.5)] * 3),
)
def test_the_whole_device_is_recovered_exactly(seed: int, dip: float, turn: tuple[float, ...]) -> None:
    held, rotation = poses(seed=seed), Rotation.from_rotvec(turn)
    hard, bias = np.array([0.4, -0.3, 0.2]), np.array([0.05, 0.02, -0.04])
    acceleration = readings(UP, held, soft_iron(seed, 0.1), bias)
    true = rotation.inv().apply(held.inv().apply(field(dip)))  # the magnetometer is turned against the accelerometer
    magnetic = true @ soft_iron(seed + 1, 0.3).T + hard
    fit = fit_calibration(acceleration, magnetic)
    np.testing.assert_allclose(fit.alignment, rotation.as_matrix(), atol=1e-6)
    assert np.degrees(fit.dip) == pytest.approx(dip, abs=1e-4)
    assert fit.dip_spread_after < 1e-6
    corrected = fit.magnetometer.correction(magnetic) @ fit.alignment.T
    np.testing.assert_allclose(normalized(corrected), held.inv().apply(field(dip)), atol=1e-6)


def test_it_does_not_matter_where_north_is() -> None:
    held, distortion, hard = poses(), soft_iron(3, 0.3), np.array([1.0, -2.0, 0.5])
    north = fit_sensor(readings(field(), held, distortion, hard), "magnetometer").correction
    for turn in Rotation.random(3, rng=np.random.default_rng(2)):
        other = fit_sensor(readings(turn.apply(field()), held, distortion, hard), "magnetometer").correction
        np.testing.assert_allclose(other.matrix, north.matrix, atol=1e-7)
        np.testing.assert_allclose(other.offset, north.offset, atol=1e-7)


def test_errors_scale_with_the_noise_and_the_spread_shows_it() -> None:
    distortion, hard = soft_iron(3, 0.3), np.array([1.0, -2.0, 0.5])
    found = [fit_sensor(readings(field(), poses(2000), distortion, hard, noise), "m") for noise in (0.002, 0.004)]
    errors = [np.linalg.norm(fit.correction.offset - hard) for fit in found]
    assert errors[1] == pytest.approx(2 * errors[0], rel=0.1)
    assert errors[0] < 0.0005
    for fit, noise in zip(found, (0.002, 0.004), strict=True):
        assert fit.spread_after == pytest.approx(noise, rel=0.5)
        assert fit.spread_before > 20 * fit.spread_after


def test_readings_of_pure_chance_are_left_out() -> None:
    distortion, hard = soft_iron(3, 0.3), np.array([1.0, -2.0, 0.5])
    vectors = readings(field(), poses(1000), distortion, hard, 0.003)
    vectors[::50] *= 1.7
    fit = fit_sensor(vectors, "magnetometer")
    assert not fit.used[::50].any()
    np.testing.assert_allclose(fit.correction.offset, hard, atol=0.002)


@pytest.mark.parametrize("side", [n for n in NAMES if len(n) == 2])
def test_a_side_that_was_never_seen_is_named(side: str) -> None:
    away = DIRECTIONS[NAMES.index(side)]
    vectors = poses(2000).apply(UP)
    kept = vectors[vectors @ away < 0.1] @ soft_iron(1, 0.1).T + [0.2, 0.1, 0.0]
    with pytest.raises(ScanError, match=rf"accelerometer: wanted.*70%.*got \d\d%.*: \{side}, "):
        fit_sensor(kept, "accelerometer")


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("width", [0.0, 5.0, 30.0])
def test_one_turn_about_one_axis_is_not_enough(width: float, noise: float) -> None:
    random = np.random.default_rng(3)
    turns = Rotation.from_euler(
        "zx", np.column_stack([np.linspace(0, 360, 500), random.uniform(-width, width, 500)]), degrees=True
    )
    for offset in (0.0, 2.0):
        vectors = turns.apply([1.0, 0.0, 0.0]) + offset + noise * random.standard_normal((500, 3))
        with pytest.raises(ScanError, match="turn it so that these are measured, too: "):
            fit_sensor(vectors, "magnetometer")


def test_a_device_at_rest_is_not_enough() -> None:
    for noise in (0.0, 0.01):
        vectors = field() + noise * np.random.default_rng(1).standard_normal((300, 3))
        with pytest.raises(ScanError, match="wanted readings with at least 70% of all directions"):
            fit_sensor(vectors, "magnetometer")


@pytest.mark.parametrize(
    ("vectors", "words"),
    [
        (np.ones((10, 3)), r"at least 50 vectors \(n, 3\), got an array of shape \(10, 3\)"),
        (np.full((100, 3), np.nan), "reading 1 is not finite, or larger"),
    ],
)
def test_what_is_no_reading_is_refused(vectors: Floats, words: str) -> None:
    with pytest.raises(ScanError, match=words):
        fit_sensor(vectors, "accelerometer")


def test_readings_of_many_fields_are_refused() -> None:
    random = np.random.default_rng(1)
    vectors = random.standard_normal((500, 3)) * random.uniform(0.1, 3.0, (500, 1))
    with pytest.raises(ScanError, match="wanted readings of one field"):
        fit_sensor(vectors, "magnetometer")


@settings(max_examples=60, deadline=None)
@given(
    scale=st.sampled_from([0.0, 1e-300, 1e-12, 1.0, 1e8, 1e300]),
    odd=st.lists(st.tuples(*[st.sampled_from([0.0, -1.0, 1e-200, 1e8, 1e300])] * 3), max_size=40),
    faces=st.none()
    | st.lists(st.tuples(*[st.sampled_from([0.0, 1.0, -1.0, 1e-200, 1e300])] * 3), min_size=1, max_size=7),
)
def test_whatever_is_measured_is_fitted_or_refused(
    scale: float, odd: list[tuple[float, ...]], faces: list[tuple[float, ...]] | None
) -> None:
    vectors = scale * poses(80).apply(UP)
    vectors[: len(odd)] = np.array(odd).reshape(-1, 3)
    try:
        fit = fit_calibration(vectors, vectors[::-1].copy(), None if faces is None else np.array(faces))
    except ScanError:
        return
    assert np.isfinite(fit.alignment).all()
    assert np.isfinite(fit.accelerometer.correction.matrix).all()


def test_coverage_counts_directions_whatever_their_length() -> None:
    assert coverage(DIRECTIONS * 7.0).fraction == 1.0
    some = coverage(np.vstack([DIRECTIONS[:13], np.zeros((2, 3)), np.full((1, 3), np.inf)]))
    assert some.fraction == 0.5
    assert set(some.missing) == set(NAMES[13:])
    assert coverage(np.empty((0, 3))).missing[:2] == ("+x", "+y")


def test_a_vertical_field_tells_nothing_of_the_alignment() -> None:
    held = poses()
    with pytest.raises(ScanError, match="so steep a field"):
        alignment(held.inv().apply(UP), held.inv().apply(field(85)))


@given(turn=st.tuples(*[st.floats(-0.15, 0.15)] * 3))
@settings(max_examples=20, deadline=None)
def test_faces_tell_how_the_sensor_sits_in_its_case(turn: tuple[float, ...]) -> None:
    rotation = Rotation.from_rotvec(turn)
    up = rotation.inv().apply(np.vstack([np.eye(3), -np.eye(3)]))
    np.testing.assert_allclose(face_rotation(up), rotation.as_matrix(), atol=1e-9)


def test_faces_correct_the_whole_calibration() -> None:
    held, case = poses(), Rotation.from_rotvec([0.05, -0.03, 0.08])
    seen = Rotation.from_matrix(held.as_matrix() @ case.as_matrix())
    acceleration, magnetic = seen.inv().apply(UP), seen.inv().apply(field())
    faces = case.inv().apply(np.vstack([np.eye(3), -np.eye(3)]))
    fit = fit_calibration(acceleration, magnetic, faces)
    np.testing.assert_allclose(fit.accelerometer.correction(acceleration), held.inv().apply(UP), atol=1e-7)
    np.testing.assert_allclose(
        fit.magnetometer.correction(magnetic) @ fit.alignment.T, held.inv().apply(field()), atol=1e-6
    )


@pytest.mark.parametrize(
    ("up", "words"),
    [
        (np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), "not all opposite"),
        (np.array([[0.0, 0.0, 1.0], [0.8, 0.6, 0.0]]), "pose 2 is 37 degrees away"),
        (np.empty((0, 3)), "not all opposite"),
    ],
)
def test_poses_that_are_no_faces_are_refused(up: Floats, words: str) -> None:
    with pytest.raises(ScanError, match=words):
        face_rotation(up)


def test_a_device_at_rest_is_told_from_one_that_moves() -> None:
    noise = 0.015 * np.random.default_rng(4).standard_normal((60, 3))
    still = np.array([0.0, -1.0, 0.02]) + noise
    still[17] = [1.0, 0.0, 0.0]
    rest = at_rest(still)
    assert rest is not None
    assert np.degrees(angles_between(rest, np.array([0.0, -1.0, 0.02]))) < 1.0
    turning = Rotation.from_rotvec(np.outer(np.linspace(0, 0.1, 60), [1, 0, 0])).apply([0.0, -1.0, 0.02])
    assert at_rest(turning + noise) is None
    assert at_rest(still[:5]) is None
    assert at_rest(np.zeros((60, 3))) is None


@given(
    circumference=st.floats(0.02, 0.5), turns=st.floats(3.1, 50), start=st.integers(0, 2**16 - 1), back=st.booleans()
)
@settings(max_examples=50, deadline=None)
def test_a_measured_run_tells_the_wheel(circumference: float, turns: float, start: int, back: bool) -> None:
    counts = start * 500 + np.linspace(0, (-1 if back else 1) * turns * 500, 200).astype(np.int64)
    ticks = np.column_stack([(counts // 500 + 2**15) % 2**16 - 2**15, counts % 500])
    found = wheel_circumference(ticks, turns * circumference, 500)
    assert found == pytest.approx(circumference, rel=2 / (500 * turns))


@pytest.mark.parametrize(
    ("counts", "length", "words"),
    [
        ([0, 900], 1.0, "at least 3 turns of the wheel, got 1.80"),
        ([0, 2000, 1000, 3000], 1.0, "the wheel went back by 2.00 of its 6.00 turns"),
        ([0, 3000], 0.0, "length of the run in metres, at least 0.001, got 0"),
        ([0, 3000], float("nan"), "length of the run"),
        ([], 1.0, "got 0.00"),
    ],
)
def test_a_run_that_tells_nothing_is_refused(counts: list[int], length: float, words: str) -> None:
    ticks = np.array([divmod(c, 500) for c in counts], np.int64).reshape(-1, 2)
    with pytest.raises(ScanError, match=words):
        wheel_circumference(ticks, length, 500)
