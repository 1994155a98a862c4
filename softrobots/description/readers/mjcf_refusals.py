"""Features of MuJoCo models that affect the statics and are not supported."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np


def name_in(model: Any, kind: str, number: int) -> str:
    """Return the name of a "body" or "joint" of a MuJoCo model; `<kind>_<number>` if it has none."""
    return str(getattr(model, kind)(number).name) or f"{kind}_{number}"


def driven_joint(mujoco: Any, model: Any, actuator: int) -> int | None:
    """Return the number of the joint that an actuator drives; None if it drives something else."""
    on_joints = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    return int(model.actuator_trnid[actuator, 0]) if int(model.actuator_trntype[actuator]) in on_joints else None


def not_carried(mujoco: Any, model: Any) -> list[str]:
    """Return the unsupported features of a compiled model, with reasons.

    Empty if its statics is that of masses, hinges, slides and linear springs.
    """
    features = [*_joints(mujoco, model), *_tendons(model), *_actuators(mujoco, model), *_elsewhere(mujoco, model)]
    return [f"{what} ({why})" for what, why in features]


def _joints(mujoco: Any, model: Any) -> Iterable[tuple[str, str]]:
    kinds, springs = np.asarray(model.jnt_type), model.jnt_stiffness != 0.0
    nonlinear = _rows(model, "jnt_stiffnesspoly", model.njnt)
    plastic = getattr(model, "jnt_plasticadr", np.full(model.njnt, -1)) >= 0
    rubbing = np.zeros(model.njnt, dtype=bool)
    for dof in range(model.nv):
        rubbing[model.dof_jntid[dof]] |= model.dof_frictionloss[dof] > 0.0
    free, ball = (kinds == int(kind) for kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL))
    for what, chosen, why in (
        ("free joints", free, "a floating base is not at rest under a load; fix it to the world"),
        ("ball joints", ball, "hinges and slides are supported"),
        ("joints with nonlinear stiffness", nonlinear & ~free, "springs are linear"),
        ("plastic joint springs", plastic, "their rest position depends on the history"),
        ("joints with spring and dry friction", springs & rubbing, "their equilibrium is not unique"),
    ):
        names = [
            f"{name_in(model, 'joint', number)} of body {name_in(model, 'body', int(model.jnt_bodyid[number]))}"
            for number in np.flatnonzero(chosen).tolist()
        ]
        if names:
            yield f"{what} {_few(names)}", why


def _tendons(model: Any) -> Iterable[tuple[str, str]]:
    for what, chosen in (
        ("tendons with stiffness", (model.tendon_stiffness != 0.0) | _rows(model, "tendon_stiffnesspoly", model.ntendon)),
        ("tendons with limits", model.tendon_limited != 0),
        ("tendons with dry friction", model.tendon_frictionloss > 0.0),
    ):
        names = [str(model.tendon(number).name) or f"tendon {number}" for number in np.flatnonzero(chosen).tolist()]
        if names:
            yield f"{what} {_few(names)}", "only joints have springs"


def _actuators(mujoco: Any, model: Any) -> Iterable[tuple[str, str]]:
    """Actuators that exert a force at zero control, except on motors, whose position is prescribed."""
    none, affine = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
    names = []
    for number, bias in enumerate(model.actuator_biastype.tolist()):
        still = bias == none or (bias == affine and not np.any(model.actuator_biasprm[number, :2]))
        still = still and not _kept_from_zero(model, number)
        joint = driven_joint(mujoco, model, number)
        if still or (joint is not None and model.jnt_stiffness[joint] == 0.0):
            continue
        names.append(str(model.actuator(number).name) or f"actuator {number}")
    if names:
        yield f"actuators with a force of their own {_few(names)}", "only joints without stiffness can be motors"


def _kept_from_zero(model: Any, actuator: int) -> bool:
    """Whether the range of its control, activation or force excludes zero, which MuJoCo then clips."""
    return any(
        limited[actuator] and not ranges[actuator, 0] <= 0.0 <= ranges[actuator, 1]
        for limited, ranges in (
            (model.actuator_ctrllimited, model.actuator_ctrlrange),
            (model.actuator_actlimited, model.actuator_actrange),
            (model.actuator_forcelimited, model.actuator_forcerange),
        )
    )


def _elsewhere(mujoco: Any, model: Any) -> Iterable[tuple[str, str]]:
    active = [mujoco.mjtEq(int(kind)).name for kind, on in zip(model.eq_type, model.eq_active0, strict=True) if on]
    if active:
        yield f"equality constraints {_few(active)}", "loops and couplings are not supported"
    if model.nflex:
        yield f"{model.nflex} flexes", "deformable bodies; a chain of hinges with stiffness is supported"
    bodies = [name_in(model, "body", number) for number in np.flatnonzero(model.body_plugin >= 0).tolist()]
    if bodies:
        yield f"plugins with forces on bodies {_few(bodies)}", "as of the cable; a chain of hinges with stiffness is supported"
    floating = [name_in(model, "body", number) for number in np.flatnonzero(model.body_gravcomp).tolist()]
    if floating:
        yield f"gravity compensation of bodies {_few(floating)}", "every body has its full weight"
    if np.any(model.opt.wind) and (model.opt.density > 0.0 or model.opt.viscosity > 0.0):
        yield "wind", "loads are given to the solvers"
    flags = mujoco.mjtDisableBit
    # Older versions have one flag for all passive forces.
    off = flags.mjDSBL_SPRING if hasattr(flags, "mjDSBL_SPRING") else flags.mjDSBL_PASSIVE
    if model.opt.disableflags & int(off) and np.any(model.jnt_stiffness):
        yield "springs that are disabled", "remove their stiffness instead"


def _rows(model: Any, field: str, count: int) -> Any:
    """Which rows of a field, absent before MuJoCo 4, are not all zero."""
    values = getattr(model, field, None)
    return np.zeros(count, dtype=bool) if values is None else np.any(np.asarray(values) != 0.0, axis=1)


def _few(names: list[str], most: int = 5) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
