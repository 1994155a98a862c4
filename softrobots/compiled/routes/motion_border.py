"""The border of the matrix of a step, traced and in loops; see `softrobots.compiled.motion.motion_routes`."""

from __future__ import annotations

from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.motion_routes import MotionRoutes
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.complex_numbers import ComplexScalar, parts_of
from softrobots.compiled.trace.expressions import Scalar
from softrobots.dynamics.gauss import SECOND


def factors_text(name: str) -> str:
    """Return the loops that factor a matrix of as many rows as the border, and solve with it, without pivoting."""
    return f'''def factor_{name}_SUFFIX(w: Array, at: int) -> None:
    """Factor the matrix."""
    for j in range(N_BORDER):
        invert_{name}_SUFFIX(w, at + (N_BORDER + 1) * j)
        for m in range(j + 1, N_BORDER):
            divide_{name}_SUFFIX(w, at + N_BORDER * m + j, at + (N_BORDER + 1) * j)
            for n in range(j + 1, N_BORDER):
                subtract_{name}_SUFFIX(w, at + N_BORDER * m + n, at + N_BORDER * m + j, at + N_BORDER * j + n)


def solve_{name}_SUFFIX(w: Array, at: int) -> None:
    """Solve with the factors."""
    for m in range(N_BORDER):
        for j in range(m):
            reduce_{name}_SUFFIX(w, m, at + N_BORDER * m + j, j)
    for k in range(N_BORDER):
        row = N_BORDER - 1 - k
        for j in range(row + 1, N_BORDER):
            reduce_{name}_SUFFIX(w, row, at + N_BORDER * row + j, j)
        scale_{name}_SUFFIX(w, row, at + (N_BORDER + 1) * row)


'''


_BORDER = '''def factor_border_SUFFIX(w: Array) -> None:
    """Solve for the rows of the border, and take their products with the answers."""
    for m in range(N_BORDER):
        for i in range(N_STRAINS):
            take_row_SUFFIX(w, i, N_STRAINS * m + i)
SOLVE_ROW        for i in range(N_STRAINS):
            keep_answer_SUFFIX(w, i, N_STRAINS * m + i)
    for m in range(N_BORDER):
        for n in range(N_BORDER):
            clear_product_SUFFIX(w, N_BORDER * m + n)
            for i in range(BORDER_FIRST[m], BORDER_LAST[m]):
                add_product_SUFFIX(w, N_BORDER * m + n, N_STRAINS * m + i, N_STRAINS * n + i)


def correct_strains_SUFFIX(w: Array) -> None:
    """Write the correction with the factors that are there, and with the border."""
    for i in range(N_STRAINS):
        take_torque_SUFFIX(w, i)
SOLVE    for m in range(N_BORDER):
        clear_multiplier_SUFFIX(w, m)
        for i in range(BORDER_FIRST[m], BORDER_LAST[m]):
            add_multiplier_SUFFIX(w, i, m, N_STRAINS * m + i)
        weigh_multiplier_SUFFIX(w, m)
        for n in range(N_BORDER):
            weigh_product_SUFFIX(w, N_BORDER * m + n, m)
        unite_system_SUFFIX(w, (N_BORDER + 1) * m)
    factor_system_SUFFIX(w, 0)
    solve_system_SUFFIX(w, 0)
    for m in range(N_BORDER):
        for i in range(N_STRAINS):
            take_answer_SUFFIX(w, i, m, N_STRAINS * m + i)


'''


def border_text(*, guides: bool) -> str:
    """Return the loops over the border; `guides`: whether some have friction, for which `guide_motion_drivers` keep an inverse.

    A factor of the stiffness counts where tensions follow the lengths, not where lengths are given.
    """
    passes = ("solve_held",) if guides else ("start_reduce_SUFFIX", "reduce_all_SUFFIX", "correct_all_SUFFIX")
    row, whole = ("".join(f"{indent}{one}(w)\n" for one in passes) for indent in (" " * 8, " " * 4))
    return _BORDER.replace("SOLVE_ROW", row).replace("SOLVE", whole)


class _Numbers:
    """Real or complex numbers at places of which the imaginary parts are `stride` behind."""

    def __init__(self, first: int, stride: int, parts: int) -> None:
        self.first, self._stride, self._parts = first, stride, parts

    def load(self, block: Block, base: str) -> Scalar:
        values = [block.load(self.first + part * self._stride, base) for part in range(self._parts)]
        return values[0] if self._parts == 1 else ComplexScalar(values[0], values[1])

    def store(self, block: Block, value: Scalar, base: str) -> None:
        parts = [value] if self._parts == 1 else parts_of([value])
        for part, number in enumerate(parts):
            block.store(self.first + part * self._stride, number, base)


def factor_blocks(name: str, matrix: int, vector: int, rows: int, parts: int = 1) -> list[Block]:
    """Trace the functions of `factors_text` for a matrix and a vector at places, row by row."""
    square, column = _Numbers(matrix, rows * rows, parts), _Numbers(vector, rows, parts)
    invert = Block(f"invert_{name}", "Invert a pivot.", ("at",))
    square.store(invert, 1.0 / square.load(invert, "at"), "at")
    divide = Block(f"divide_{name}", "Divide an entry by a pivot.", ("at", "pivot"))
    square.store(divide, square.load(divide, "at") * square.load(divide, "pivot"), "at")
    subtract = Block(f"subtract_{name}", "Eliminate an entry.", ("at", "lower", "upper"))
    product = square.load(subtract, "lower") * square.load(subtract, "upper")
    square.store(subtract, square.load(subtract, "at") - product, "at")
    reduce = Block(f"reduce_{name}", "Eliminate a number of the right-hand side.", ("m", "at", "j"))
    column.store(reduce, column.load(reduce, "m") - square.load(reduce, "at") * column.load(reduce, "j"), "m")
    scale = Block(f"scale_{name}", "Divide a number of the right-hand side by a pivot.", ("m", "pivot"))
    column.store(scale, column.load(scale, "m") * square.load(scale, "pivot"), "m")
    return [invert, divide, subtract, reduce, scale]


def border_blocks(plan: MotionPlan, routes: MotionRoutes) -> list[Block]:
    """Trace the functions that `BORDER` calls."""
    n, c, parts, held = len(plan.unknowns.strains), routes.rows, routes.parts, routes.held
    answers, products, system, multipliers = (
        _Numbers(first, stride, parts)
        for first, stride in (
            (routes.answers, c * n),
            (routes.products, c * c),
            (routes.system, c * c),
            (routes.multipliers, c),
        )
    )

    def correction(block: Block) -> Scalar:
        stages = [block.load(plan.correction + stage * n, "i") for stage in range(parts)]
        return stages[0] if parts == 1 else ComplexScalar(stages[0], stages[1] * SECOND)

    row = Block("take_row", "Take a row of the border as right-hand side.", ("i", "row"))
    torque = Block("take_torque", "Take the torques out of balance as right-hand side.", ("i",))
    for stage in range(parts):
        torque.store(routes.sides + stage, torque.load(routes.torques + stage, plan.row("i")), plan.row("i"))
        row.store(routes.sides + stage, 0.0 if stage else row.load(routes.border, "row"), plan.row("i"))
    keep = Block("keep_answer", "Keep the answer to a row of the border.", ("i", "row"))
    answers.store(keep, -correction(keep), "row")
    clear, clear_one = (
        Block("clear_product", "Clear a product.", ("at",)),
        Block("clear_multiplier", "Clear a multiplier.", ("m",)),
    )
    products.store(clear, 0.0 if parts == 1 else ComplexScalar(0.0, 0.0), "at")
    multipliers.store(clear_one, 0.0 if parts == 1 else ComplexScalar(0.0, 0.0), "m")
    add = Block("add_product", "Add the product of a row and an answer.", ("at", "row", "other"))
    products.store(add, products.load(add, "at") + answers.load(add, "other") * add.load(routes.border, "row"), "at")
    add_one = Block("add_multiplier", "Add the product of a row and the correction.", ("i", "m", "row"))
    multipliers.store(add_one, multipliers.load(add_one, "m") + correction(add_one) * add_one.load(routes.border, "row"), "m")
    weigh = Block(
        "weigh_product", "Take a product times the stiffness of an actuator, where lengths are not given.", ("at", "m")
    )
    weigh_one = Block("weigh_multiplier", "Take a multiplier times that.", ("m",))
    unite = Block("unite_system", "Add one, where lengths are not given.", ("at",))
    shares = [1.0 if held else plan.factors(one)[1] * one.load(routes.stiffness, "m") for one in (weigh, weigh_one)]
    system.store(weigh, products.load(weigh, "at") * shares[0], "at")
    multipliers.store(weigh_one, multipliers.load(weigh_one, "m") * shares[1], "m")
    if not held:
        system.store(unite, system.load(unite, "at") + 1.0, "at")
    take = Block("take_answer", "Take an answer times its multiplier from the correction.", ("i", "m", "row"))
    corrected = correction(take) - answers.load(take, "row") * multipliers.load(take, "m")
    for stage, value in enumerate([corrected] if parts == 1 else parts_of([corrected])):
        take.store(plan.correction + stage * n, value if stage == 0 else value * (1.0 / SECOND), "i")
    return [
        *(row, torque, keep, clear, clear_one, add, add_one, weigh, weigh_one, unite, take),
        *factor_blocks("system", routes.system, routes.multipliers, c, parts),
    ]
