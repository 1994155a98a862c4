"""One inflated link as a beam: bending and wrinkling, characterisation data; [Troise 2021] section 2.1."""

from softrobots.inflated_beam.beam import (
    POISSON_RATIO,
    SHEAR_COEFFICIENT,
    BeamStiffness,
    beam_stiffness,
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
    BendingData,
    CharacterisationRow,
    moment,
    read_characterisation,
    required_tabulated_pressure,
)
from softrobots.inflated_beam.characterisation_fit import Characterisation, fit_characterisation
from softrobots.inflated_beam.membrane_tube import MomentLimits, SlackWallMoment, moment_limits, slack_wall_moment
from softrobots.inflated_beam.two_hinges import TwoHinges, two_hinges

__all__ = [
    "MEAN_STIFFNESS",
    "POISSON_RATIO",
    "SHEAR_COEFFICIENT",
    "TABLE_3",
    "BeamStiffness",
    "BendingData",
    "BendingTest",
    "Characterisation",
    "CharacterisationRow",
    "MomentLimits",
    "SlackWallMoment",
    "TwoHinges",
    "beam_stiffness",
    "deflection",
    "fit_characterisation",
    "moment",
    "moment_limits",
    "read_characterisation",
    "required_pressure",
    "required_tabulated_pressure",
    "slack_wall_moment",
    "stiffness_from_young_modulus",
    "two_hinges",
    "wrinkling_moment",
    "young_modulus_from_stiffness",
]
