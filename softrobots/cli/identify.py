"""`softrobots identify`: parameters of a robot from measurements."""

from __future__ import annotations

import argparse
import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.cli.options.robot_argument import add_model, statics_model_of
from softrobots.cli.options.robot_parameters import name_of, write_robot
from softrobots.cli.reports.answers import add_json, plain, print_answer
from softrobots.cli.reports.identification_report import identification_answer, identification_lines, prediction_table
from softrobots.core.checks import positive_integer
from softrobots.core.errors import MissingDependency, ParameterError, ViewerError
from softrobots.core.files import csv_text, new_file, write_text
from softrobots.core.result_file import save_result
from softrobots.identification.cross_validation import CrossValidation, cross_validate
from softrobots.identification.fit import INTERRUPTED
from softrobots.identification.identification import Identification
from softrobots.identification.identify import LOSSES, identify
from softrobots.identification.measured_robot import frame_of
from softrobots.identification.measurement_checks import labelled
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.suspicions import doubtful_sizes, hints
from softrobots.model.soft_model import SoftModel
from softrobots.robots.placed_robot import Marker, RobotPlacement
from softrobots.view.figures.canvas import write_png
from softrobots.view.figures.experiments import cross_validation
from softrobots.view.figures.identifications import identification_figures
from softrobots.view.identification_page import IdentificationPage

_EXAMPLES = """examples:
  softrobots identify poses.csv --robot inflatable_arm --columns columns.yaml --fit stiffness,hinge_offset -o fit/
  softrobots identify train.csv --robot tendon_arm --columns columns.yaml --fit base.position,base.rotation,young_modulus \
--validate val.csv --loss soft_l1 -o fit/
  softrobots identify poses.csv --robot arm.urdf --fit joint[elbow].stiffness --prior joint[elbow].stiffness=40,10 \
--hold-out 'day2_*'
  softrobots identify poses.csv --robot pcc_arm --fit bending_stiffness --fit segment[*].bending_stiffness --families 'day[0-9]'
"""

_FILES = ("report.txt", "identification.json", "identification.npz", "predictions.csv", "robot.yaml", "page.html")
_PICTURES = ("residuals", "predicted", "values", "correlation", "ellipses", "cross_validation")


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "identify",
        help="fit parameters of a robot to measurements",
        description="Fit parameters of a robot to measured positions, poses, torques, tensions, frequencies or damping ratios "
        "at rest, by least squares with exact derivatives. Exit status 0 if the fit converges, 1 if not, 2 after bad input, "
        "130 after Ctrl-C, which writes what there is.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("data", type=Path, metavar="DATA.csv", help="measured rows; the first line names the columns")
    add_model(parser, option=True)
    help_text = (
        "which columns are what, in which units: a YAML or JSON file, e.g. with lines `actuators: {columns: [q1, q2], "
        "unit: deg}`, `positions: {tip: {columns: [x, y, z], unit: mm}}`, `mass: {columns: hung, unit: g}`, "
        "`gravity: [0, 0, -9.81]` and `labels: set` (told by DATA.csv itself)"
    )
    parser.add_argument("--columns", type=Path, metavar="FILE", help=help_text)
    help_text = (
        "names of the parameters to fit, with commas between: fields of the robot (stiffness or link_lengths: one value "
        "for all links, link[*].stiffness or link_lengths[*]: one for each), link[2].stiffness, "
        "joint[NAME].stiffness, base.position, base.rotation, marker.NAME.offset, motor[*].offset; given several times, the "
        "set with the least error on families of rows that are left out in turn is taken (required)"
    )
    parser.add_argument("--fit", action="append", required=True, metavar="NAME,NAME", help=help_text)
    help_text = (
        "what is known of a parameter before: mean (the value that the robot has) and standard deviation, in its unit or as in "
        "10%% of the mean; once for each (nothing)"
    )
    parser.add_argument("--prior", action="append", type=prior, default=[], metavar="NAME=[MEAN,]STD", help=help_text)
    help_text = "loss of a residual; outliers count less in all but the first (%(default)s)"
    parser.add_argument("--loss", choices=LOSSES, default=LOSSES[0], help=help_text)
    help_text = "number of starts: the present values, then random ones around them (%(default)s)"
    parser.add_argument("--starts", type=int, default=1, metavar="N", help=help_text)
    aside = parser.add_mutually_exclusive_group()
    help_text = "other rows, with the same columns, that are predicted and not fitted (none)"
    aside.add_argument("--validate", type=Path, metavar="OTHER.csv", help=help_text)
    help_text = "labels of rows, or patterns of them, that are predicted and not fitted (none)"
    aside.add_argument("--hold-out", nargs="+", metavar="LABEL", help=help_text)
    help_text = (
        "family of a label: what this regular expression finds in it, or its group; families are left out in turn to tell the "
        "error on what was not seen (each label is one)"
    )
    parser.add_argument("--families", metavar="REGEX", help=help_text)
    help_text = f"folder for {', '.join(_FILES)} and pictures; robot.yaml is a robot for every other command (not saved)"
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help=help_text)
    parser.add_argument("--overwrite", action="store_true", help="allow files to be replaced")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> bool:
    """Read, fit, write the files and print the answer; return False if the fit did not converge."""
    positive_integer("--starts", arguments.starts)
    if len(dict(arguments.prior)) < len(arguments.prior):
        raise ParameterError("--prior", [name for name, _ in arguments.prior], "given once for each parameter")
    if arguments.output is not None:
        for name in (*_FILES, *(f"{picture}.png" for picture in _PICTURES)):
            new_file(arguments.output / name, overwrite=arguments.overwrite)
    model = statics_model_of(arguments, placed=False)  # base and markers are fitted anew
    rows = Measurements.from_csv(arguments.data, arguments.columns)
    rows.check(model)
    rows = rows.in_order_of(model)
    for doubt in doubtful_sizes(rows, model):
        warnings.warn(doubt, stacklevel=1)
    sets = {text: re.split(r",(?![^\[]*\])", text.replace(" ", "")) for text in arguments.fit}
    priors = {}
    for name, (mean, std, relative) in arguments.prior:
        values = ParameterSet.of(model, name, rows.markers).values if mean is None else np.array(mean)
        priors[name] = (values, std * np.abs(values) if relative else std)
    options = {"loss": arguments.loss, "priors": priors, "starts": arguments.starts}
    aside: Any = arguments.hold_out
    if arguments.validate is not None:
        aside = Measurements.from_csv(arguments.validate, arguments.columns)
    try:
        compared = _compare(arguments, model, rows, sets, options)
        chosen = arguments.fit[0] if compared is None else compared.best
        found = identify(model, rows, sets[chosen], validation=aside, progress=True, **options)
    except ParameterError as error:
        if error.field != "parameters":
            raise
        raise ParameterError("--fit", error.value, error.requirement) from error
    files = [] if arguments.output is None else _write_fit(arguments, found)
    causes = [] if found.message == INTERRUPTED else hints(found, progress=True)
    answer, lines = identification_answer(found, compared, causes), identification_lines(found, compared, causes)
    files += [] if arguments.output is None else _write_report(arguments, found, compared, answer, lines)
    if found.robot is not None and any(file.name == "robot.yaml" for file in files):
        lines += ["", f"as a robot: softrobots solve {arguments.output / 'robot.yaml'}"]
        kept = ("field", "base", "marker")
        others = [one.name for one in found.parameters if one.place.kind not in kept]
        lines += [f"not parameters of the robot, so not in robot.yaml: {', '.join(others)}"] if others else []
    print_answer(arguments, answer, lines, files)
    if found.message == INTERRUPTED:
        raise KeyboardInterrupt
    return found.message == "converged"


def prior(word: str) -> tuple[str, tuple[float | None, float, bool]]:
    """Parse NAME=[MEAN,]STD[%]: mean (None if it is not told), standard deviation, and whether that is relative."""
    name, _, numbers = word.rpartition("=")
    *mean, std = numbers.split(",")
    try:
        known = [float(one) for one in mean]
        size = float(std.removesuffix("%")) * (0.01 if std.endswith("%") else 1.0)
    except ValueError:
        name = ""
    if not name or len(mean) > 1:
        raise argparse.ArgumentTypeError(f"{word!r}: NAME=MEAN,STD or NAME=STD is required")
    return name, (known[0] if known else None, size, std.endswith("%"))


def _compare(
    arguments: argparse.Namespace, model: SoftModel, rows: Measurements, sets: dict[str, list[str]], options: dict[str, Any]
) -> CrossValidation | None:
    """The errors of sets of parameters on families that are left out, if that is asked for."""
    if len(sets) == 1 and arguments.families is None:
        return None
    held = labelled(rows.labels or ("",) * len(rows), arguments.hold_out or ())
    seen = Measurements(**rows.arguments() | {"mask": rows.mask & ~held})  # with dry friction all rows happen
    return cross_validate(model, seen, sets, arguments.families, progress=True, **options)


def _write_fit(arguments: argparse.Namespace, found: Identification) -> list[Path]:
    """Write what a fit has found."""
    folder, overwrite = arguments.output, arguments.overwrite
    files = [
        save_result(found, folder / "identification.npz", overwrite=overwrite),
        write_text(folder / "predictions.csv", csv_text(*prediction_table(found)), overwrite=overwrite),
    ]
    name = None if found.robot is None else name_of(found.robot)
    if name is not None:
        placement = placement_of(found).values()
        files.append(write_robot(folder / "robot.yaml", name, found.robot, placement, overwrite=overwrite))
    return files


def _write_report(
    arguments: argparse.Namespace,
    found: Identification,
    compared: CrossValidation | None,
    answer: dict[str, Any],
    lines: list[str],
) -> list[Path]:
    """Write what is said of a fit; without matplotlib no pictures."""
    folder, overwrite = arguments.output, arguments.overwrite
    files = [
        write_text(folder / "report.txt", "\n".join(lines) + "\n", overwrite=overwrite),
        write_text(folder / "identification.json", json.dumps(plain(answer), indent=2) + "\n", overwrite=overwrite),
    ]
    for draw in (_pictures, _page):
        try:
            files += draw(folder, found, compared, overwrite)
        except (MissingDependency, ViewerError) as error:
            warnings.warn(f"not all is drawn: {error}", stacklevel=1)
    return files


def placement_of(found: Identification) -> RobotPlacement:
    """Return base and markers that a fit has found; markers on what is no link are left out.

    In a description a marker is a link: one that is called as another link, or with signs that links have not, is renamed.
    """
    parameters, marked = ParameterSet(found.model, found.parameters, found.fitted.measurements.markers), []
    taken = {frame.name for frame in found.model.pinocchio.frames}
    for name in dict.fromkeys(one.place.names[0] for _, one in parameters.places("marker")):
        frame = frame_of(found.model, name, found.fitted.measurements.markers)
        if found.model.pinocchio.existBodyName(frame):
            link = re.sub(r"\W", "_", name)
            while link in taken:
                link += "_marker"
            taken.add(link)
            marked.append(Marker(link, frame, tuple(parameters.marker_offset(found.solution, name).tolist())))
    position, rotation = (tuple(one.tolist()) for one in parameters.base(found.solution))
    return RobotPlacement(position, rotation, tuple(marked))


def _pictures(folder: Path, found: Identification, compared: CrossValidation | None, overwrite: bool) -> list[Path]:
    """Write the figures of a fit."""
    figures = identification_figures(found) | ({} if compared is None else {"cross_validation": cross_validation(compared)})
    return [write_png(figure, folder / f"{key}.png", overwrite=overwrite) for key, figure in figures.items()]


def _page(folder: Path, found: Identification, compared: CrossValidation | None, overwrite: bool) -> list[Path]:
    """Write the page of measured and predicted poses, if there are any."""
    if not any(key.startswith(("positions.", "poses.")) for key in found.residuals):
        return []
    with IdentificationPage(found) as page:
        return [page.write_html(folder / "page.html", title="Measured and predicted poses", overwrite=overwrite)]
