"""How contact forces follow motors, loads and obstacles."""

from __future__ import annotations

from typing import NamedTuple

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.summary import summarised
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact import Contact
from softrobots.statics.contact.held import held_contacts
from softrobots.statics.equilibrium_result import Equilibrium, check_same_model
from softrobots.statics.sensitivity import inverse_in_contact, tip_columns


@summarised
class ContactSensitivity(NamedTuple):
    """Derivatives of the k normal forces of an equilibrium whose pressed contacts stay pressed; see `contact_sensitivity`."""

    contacts: tuple[Contact, ...]
    """The pressed contacts."""
    by_motors: FloatArray
    """Normal forces by the actuators, shape (k, n_motors) [N/rad, N/m, -; N/Pa]."""
    by_wrench: FloatArray
    """Normal forces by a wrench added at the tip, world axes, force first, shape (k, 6) [-, 1/m]."""
    by_approach: FloatArray
    """Normal forces by obstacles that come nearer, each along the normal of its contact, shape (k, k) [N/m]."""
    springs_by_approach: FloatArray
    """Springs by the same, shape (n_springs, k) [rad/m or m/m]."""


def contact_sensitivity(model: SoftModel, equilibrium: Equilibrium) -> ContactSensitivity:
    r"""Differentiate the contact forces of an equilibrium by motors, loads and obstacles.

    With the Hessian of the Lagrangian, the gradients `G` of the pressed gaps by springs and `G_m` by motors, the forces follow
    motors by :math:`d\lambda/dq_m = F C - S G_m` and obstacles that come nearer by `S`: blocks of the inverse of the bordered
    matrix (`softrobots.statics.sensitivity.inverse_in_contact`).

    Args:
        model: The robot.
        equilibrium: An equilibrium of it, in contact or not.

    Returns:
        The derivatives; with no rows where nothing is pressed.

    Raises:
        ParameterError: If the equilibrium belongs to another model, or a contact slips, or must as motors move.
        NeutralEquilibrium: If the stiffness beside the contacts is singular.
    """
    check_same_model(model, equilibrium)
    pressed = held_contacts(equilibrium, "a derivative of its forces", moves=True)
    gradients, by_motors = equilibrium.tangent_stiffness[:0], equilibrium.coupling[:0]
    if pressed is not None:
        gradients, by_motors, _ = pressed
    inverse = inverse_in_contact(model, equilibrium.tangent_stiffness, gradients)
    _, springs = tip_columns(model, equilibrium.q_motors, equilibrium.q_springs)
    contacts = tuple(contact for contact in equilibrium.contacts if contact.strict)
    k, motors = len(contacts), inverse.forces_by_load @ equilibrium.coupling - inverse.forces_by_gap @ by_motors
    return ContactSensitivity(
        contacts=contacts,
        by_motors=read_only(motors[:k]),
        by_wrench=read_only((inverse.forces_by_load @ springs.T)[:k]),
        by_approach=read_only(inverse.forces_by_gap[:k, :k]),
        springs_by_approach=read_only(inverse.springs_by_gap[:, :k]),
    )
