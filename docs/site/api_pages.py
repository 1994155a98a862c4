"""The pages of the API reference: for each a title, a sentence, and the names that it documents, in order.

The name of a package stands for everything that it exports, that of a module for everything public in it. A test checks that
no public name is left out.
"""

from __future__ import annotations

import ast
import importlib
import json
from pathlib import Path
from typing import NamedTuple

import softrobots


class ApiPage(NamedTuple):
    """One page."""

    title: str
    """Its heading."""
    summary: str
    """What the page documents, in a sentence."""
    names: tuple[str, ...]
    """Full names: of things, or of modules of which everything public is shown."""


PACKAGES = tuple(f"softrobots.{name}" for name in ("inflated_beam", "constant_curvature", "helix", "export", "compiled.sweeps"))
"""Names of packages, which are documented by what they export, module by module."""


FIGURES = Path(softrobots.__file__).parent / "view" / "figures"

BEHIND_GUIDES = "---\nsearch:\n  boost: 0.5\n---\n\n"
"""Front matter that ranks a page behind the guides in a search."""


def _top(*names: str) -> tuple[str, ...]:
    return tuple(f"softrobots.{name}" for name in names)


PAGES = {
    "robots": ApiPage(
        "Robots and models",
        "Parameters of a robot, what is loaded of it, and one robot on another.",
        (
            *_top(
                "InflatableArm",
                "PccArm",
                "TendonArm",
                "HelixTube",
                "Route",
                "ROBOTS",
                "robots.Robot",
                "robots.fields.XacroRobot",
            ),
            *_top("robots.inflated_links.InflatedLinks", "robots.continuum_arm.ContinuumArm", "AssumedStiffnessWarning"),
            *(
                f"softrobots.robots.fields.{name}"
                for name in ("parameter", "per_part", "per_actuator", "check_parameters", "Facts")
            ),
            *_top("load_model", "with_springs", "with_points", "SoftModel", "SpringGroup", "grown_coordinates"),
            *(f"softrobots.robots.parameter_file.{name}" for name in ("read_robot", "read_parameters", "write_parameters")),
            *_top("capsule_error"),
            *_top("mount", "description.third_party.robot_file", "__version__"),
        ),
    ),
    "statics": ApiPage(
        "Statics",
        "Equilibria under loads, how the robot gives way, when it buckles, and which load it feels.",
        (
            *_top("solve_equilibrium", "Equilibrium", "LinkLimits", "Stability", "distributed_force", "EARTH_GRAVITY"),
            *_top("compliance", "elastostatic_jacobian", "critical_load", "estimate_load", "LoadEstimate"),
            *_top("post_buckling_branches", "EquilibriumBranch"),
            *_top("solve_imposed_displacement", "ImposedDisplacement"),
            *_top("follow_contact", "ContactPath"),
            *(f"softrobots.statics.contact.contact_path.{name}" for name in ("ContactEvent", "ContactJump")),
            *_top("contact_sensitivity", "locate_contact", "contact_wrench", "is_force_closure", "pull_out_force"),
            "softrobots.statics.contact.clearance.Clearance",
            "softrobots.statics.contact.contact_sensitivity.ContactSensitivity",
            "softrobots.statics.tip_force.contact_place.ContactPlace",
            *(f"softrobots.statics.contact.grasp.{name}" for name in ("ForceClosure", "PullOut")),
        ),
    ),
    "environment": ApiPage(
        "Environment",
        "Obstacles that a robot touches.",
        (*_top("Environment", "HalfSpace", "Sphere", "Box", "Cylinder", "Capsule", "Mesh"),),
    ),
    "kinematics": ApiPage(
        "Inverse kinematics and paths",
        "Motors that put the loaded tip where it is wanted, along a path too, and what the tip reaches.",
        (
            *_top("solve_ik", "IkSolution", "follow_trajectory", "Trajectory"),
            *_top("Path3D", "quintic", "straight_line", "waypoints", "read_waypoints", "sample_workspace", "Workspace"),
        ),
    ),
    "motion": ApiPage(
        "Motion",
        "Simulation, vibration modes, linear models for controllers, damping, and motor paths that leave no vibration behind.",
        (
            *_top("simulate", "Motion", "MotionState", "dynamics.motion.MotionEnergy"),
            *_top("vibration_modes", "VibrationModes", "dynamics.vibration.ModeSwing", "linearize", "LinearModel"),
            *_top("ring_down", "RingDown", "damping_time_from_decrement"),
            *_top("PD", "ClosedLoop"),
            *_top("shape_input", "ShapedTrajectory", "input_shaper", "InputShaper", "residual_vibration"),
        ),
    ),
    "identification": ApiPage(
        "Identification",
        "What was measured of a robot, and the parameters that explain it.",
        (
            *_top("sensitivity", "Sensitivity", "Measurements", "identify", "Identification"),
            *_top("cross_validate", "CrossValidation", "informative_poses", "InformativePoses"),
            *("softrobots.identification.parameters", "softrobots.identification.measurement_columns.read_columns"),
        ),
    ),
    "inflated_beam": ApiPage("inflated_beam", "One inflated link as a beam.", _top("inflated_beam")),
    "constant_curvature": ApiPage(
        "constant_curvature", "Segments of constant curvature in closed form.", _top("constant_curvature")
    ),
    "helix": ApiPage("helix", "Helical actuation of an inflated tube in closed form.", _top("helix")),
    "export": ApiPage("export", "Robots in the formats of other tools.", _top("export")),
    "compile": ApiPage(
        "compile and sweeps",
        "Compiled solvers, and sweeps over millions of cases. `softrobots.compile` is `compile_model` here; a star import "
        "leaves it out, since it would hide the builtin.",
        (
            *(f"softrobots.compiled.run.compiled_model.{name}" for name in ("compile_model", "CompiledModel")),
            "softrobots.compiled.run.compiled_statics.CompiledStatics",
            "softrobots.compiled.run.compiled_code.CompiledCode",
            "softrobots.compiled.statuses.Status",
            *(f"softrobots.compiled.run.results.{name}" for name in ("CompiledEquilibrium", "CompiledLoadEstimate")),
            *(f"softrobots.compiled.run.results.{name}" for name in ("EquilibriumBatch", "LoadBatch", "MotorBatch")),
            *(f"softrobots.compiled.run.contact_batches.{name}" for name in ("ContactBatch", "ContactEquilibrium")),
            *_top("compiled.sweeps"),
        ),
    ),
    "learning": ApiPage(
        "jax and torch",
        "Equilibria and load estimates as functions of JAX and PyTorch, with derivatives (extras `jax`, `torch`).",
        tuple(f"softrobots.{name}.{function}" for name in ("jax", "torch") for function in ("equilibrium", "load_estimate")),
    ),
    "viewer": ApiPage(
        "Viewer",
        "The robot in a browser: as a page on loopback, as a file of its own, with sliders, or following commands.",
        (
            *_top(
                "view",
                "Viewer",
                "interactive",
                "view.served_page.ServedPage",
                "view.meshcat_page.page_text.InlinePage",
                "view.slider_page.SliderPage",
            ),
            *_top("view.identification_page.IdentificationPage"),
            *_top("view.live.loop.LiveView", "view.live.commands.Wanted", "view.live.commands.GRAMMAR", "view.live.keys.KEYS"),
        ),
    ),
    "plots": ApiPage(
        "Plots",
        "Pictures with matplotlib (extra `plot`). Each function returns a figure; `savefig` writes it.",
        (*_top("plot"), *(f"softrobots.view.figures.{path.stem}" for path in sorted(FIGURES.glob("[a-z]*.py")))),
    ),
    "results": ApiPage(
        "Files and results", "Results as files, without pickle.", _top("save_result", "load_result", "save_csv", "to_dataframe")
    ),
    "errors": ApiPage(
        "Errors",
        "Everything that is raised on purpose. `except softrobots.SoftRobotsError` catches it all.",
        _top("core.errors", "SuspiciousInputWarning"),
    ),
    "command_line": ApiPage(
        "Command line",
        "The command `softrobots` from Python, and what the scripts share.",
        (*_top("cli.main.main", "cli.main.parser"), "softrobots.cli.options.command_line"),
    ),
}
"""The pages, by the name of their file."""


def parts(package: str) -> dict[str, list[str]]:
    """The public names of a package by the module that they come from, in the order of its imports."""
    (init,) = importlib.import_module(package).__path__
    tree = ast.parse((Path(init) / "__init__.py").read_text(encoding="utf-8"))
    public = set(importlib.import_module(package).__all__)
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    names_by_module = {str(node.module): [alias.name for alias in node.names if alias.name in public] for node in imports}
    return {module: names for module, names in names_by_module.items() if names}


def page_text(page: ApiPage) -> str:
    """A page as Markdown for mkdocstrings."""
    blocks = [f"{BEHIND_GUIDES}# {page.title}\n\n{page.summary}\n"]
    for name in page.names:
        if name in PACKAGES:
            blocks.append(f"Everything here is imported as `{name}.NAME`.\n")
            blocks += [_block(module, members=names) for module, names in parts(name).items()]
        else:
            blocks.append(_block(name))
    return "\n".join(blocks)


def _block(name: str, members: list[str] | None = None) -> str:
    """One thing, or a module with some of its members."""
    chosen = "" if members is None else f"    options:\n      members: {json.dumps(members)}\n"
    return f"::: {name}\n{chosen}"


def overview() -> str:
    """The page that lists the others."""
    rows = "\n".join(f"| [{page.title}]({name}.md) | {page.summary} |" for name, page in PAGES.items())
    return f"# API reference\n\nFrom the docstrings. SI units and radians everywhere.\n\n| page | |\n|---|---|\n{rows}\n"
