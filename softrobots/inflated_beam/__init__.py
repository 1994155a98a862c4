"""One inflated link as a beam: bending and wrinkling, characterisation data, inflation; [Troise 2021] section 2.1."""

from softrobots.inflated_beam.beam import (
    SHEAR_COEFFICIENT,
    deflection,
    required_pressure,
    stiffness_from_young_modulus,
    wrinkling_moment,
    young_modulus_from_stiffness,
)
from softrobots.inflated_beam.bending_test import BendingTest
from softrobots.inflated_beam.characterisation import (
    MEAN_STIFFNESS,
    TABLE_3,
    Characterisation,
    CharacterisationRow,
    fit_characterisation,
    moment,
    required_tabulated_pressure,
)
from softrobots.inflated_beam.inflation import tank_pressure, tank_volume, volume

__all__ = [
    "MEAN_STIFFNESS",
    "SHEAR_COEFFICIENT",
    "TABLE_3",
    "BendingTest",
    "Characterisation",
    "CharacterisationRow",
    "deflection",
    "fit_characterisation",
    "moment",
    "required_pressure",
    "required_tabulated_pressure",
    "stiffness_from_young_modulus",
    "tank_pressure",
    "tank_volume",
    "volume",
    "wrinkling_moment",
    "young_modulus_from_stiffness",
]
