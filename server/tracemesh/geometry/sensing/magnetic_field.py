"""The Earth's magnetic field where a scan was made: from place and date, or as a device at rest measured it."""

from datetime import date

import numpy as np
from pygeomag import GeoMag, calculate_decimal_year
from pygeomag.wmm.wmm_2015v2 import WMM_2015v2
from pygeomag.wmm.wmm_2020 import WMM_2020
from pygeomag.wmm.wmm_2025 import WMM_2025

from tracemesh.errors import InputError, ScanError
from tracemesh.geometry.rotations import normalized
from tracemesh.geometry.sensing.orientation import Floats, ReferenceField, angles_between

FIRST_YEAR, LAST_YEAR = 2015, 2029
"""Years, both included, for which the World Magnetic Model is known."""
WEAKEST = 2000.0
"""nT, horizontally; the model's own limit under which a compass shows nothing (near the magnetic poles)."""
STILL = np.radians(3.0)
"""How far a vector may be from the mean of a device at rest."""


def field_at(latitude: float, longitude: float, on: date, altitude: float = 0.0) -> ReferenceField:
    """The field at a place and date by the World Magnetic Model: y is magnetic North, z is up.

    latitude, longitude: degrees, WGS 84, North and East positive. altitude: m. Raises InputError where the numbers are
    no place, the model does not know the date, or a compass shows nothing.
    """
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise InputError(
            f"wanted a latitude from -90 to 90 and a longitude from -180 to 180, got {latitude:g}, {longitude:g}"
        )
    if not FIRST_YEAR <= on.year <= LAST_YEAR:
        raise InputError(f"the World Magnetic Model is known for the years {FIRST_YEAR} to {LAST_YEAR}, got {on}")
    field = _model(on.year).calculate(latitude, longitude, altitude / 1000, calculate_decimal_year(on))
    if field.in_blackout_zone:
        raise InputError(f"at {latitude:g}, {longitude:g} the field is too steep for a compass to show where North is")
    return ReferenceField.from_inclination(np.radians(field.inclination))


def field_at_rest(acceleration: Floats, magnetic: Floats) -> ReferenceField:
    """The field that a device at rest measured, in any one pose: y is magnetic North, z is up.

    acceleration, magnetic: (n, 3), device axes, any unit. Raises ScanError where a vector is zero or not finite, or
    the device moved.
    """
    means = []
    for name, vectors in (("acceleration", acceleration), ("magnetic field", magnetic)):
        bad = ~(np.isfinite(vectors).all(axis=1) & vectors.any(axis=1))
        if bad.any():
            raise ScanError(f"{name}: sample {int(bad.argmax()) + 1} is not a finite vector other than zero")
        directions = normalized(vectors)
        mean = directions.mean(axis=0)
        off = angles_between(directions, mean)
        if off.max() > STILL:
            raise ScanError(
                f"wanted a device at rest, got a direction of the {name} that is {np.degrees(off.max()):.0f} degrees "
                f"from the mean at sample {int(off.argmax()) + 1}"
            )
        means.append(mean)
    return ReferenceField.from_inclination(float(angles_between(*means)) - np.pi / 2)


def _model(year: int) -> GeoMag:
    coefficients = {2015: WMM_2015v2, 2020: WMM_2020, 2025: WMM_2025}
    return GeoMag(coefficients_data=coefficients[year - year % 5])
