"""Where the locals of a function in the kernel language are declared in C: as late as may be, as constants if they are.

Python has one scope in a function, C one in each block. A local is declared with its first assignment if that stands in the
innermost block that holds all its uses; then every way to a use passes it. Otherwise it is declared before, outside of all
loops, as zero.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from softrobots.compiled.c.kernel_language import Function, Module


@dataclass(frozen=True)
class Locals:
    """The locals of a function."""

    stores: Counter[str]
    """How often each is assigned in the text."""
    read: frozenset[str]
    """Names that are read."""
    with_assignment: frozenset[str]
    """Those whose first assignment declares them."""
    before: dict[ast.stmt, tuple[str, ...]]
    """Those to declare before a statement of the function's own block."""


def plan_locals(module: Module, function: Function) -> Locals:
    """Decide where each local is declared.

    Args:
        module: The module, for errors.
        function: One of its functions.

    Returns:
        The plan.

    Raises:
        ParameterError: If the variable of a `for` is used outside of its loops, or assigned in one.
    """
    uses = _Uses(function.body)
    parameters = {parameter.name for parameter in function.parameters}
    loops = _loop_variables(module, function, uses, parameters)
    names = [node for statement in function.body for node in ast.walk(statement) if isinstance(node, ast.Name)]
    stores = Counter(node.id for node in names if isinstance(node.ctx, ast.Store))
    inline = set()
    before: defaultdict[ast.stmt, list[str]] = defaultdict(list)
    for name in stores:
        if name in parameters or name in loops:
            continue
        match uses.home(function.body, name):
            case ast.Assign(targets=[ast.Name(id=target)], value=value) if target == name and not mentions(value, {name}):
                inline.add(name)
            case _:
                before[uses.in_block(function.body, name)[0]].append(name)
    read = frozenset(node.id for node in names if isinstance(node.ctx, ast.Load))
    return Locals(stores, read, frozenset(inline), {at: tuple(declared) for at, declared in before.items()})


def loop_variable(node: ast.stmt) -> str | None:
    """The name that a `for` counts with; None for other statements."""
    match node:
        case ast.For(target=ast.Name(id=name)):
            return name
    return None


def assigned_in(block: Sequence[ast.stmt]) -> set[str]:
    """Names that are assigned in a block."""
    nodes = (node for statement in block for node in ast.walk(statement))
    return {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}


def mentions(node: ast.AST, names: set[str]) -> bool:
    """Whether one of the names stands in a piece of the text."""
    return any(isinstance(inner, ast.Name) and inner.id in names for inner in ast.walk(node))


class _Uses:
    """Which statements use which names, each looked at once."""

    def __init__(self, body: Sequence[ast.stmt]) -> None:
        self.count: dict[ast.stmt, Counter[str]] = {}  # how often a statement, with its blocks, has a name
        self._users: dict[int, defaultdict[str, list[ast.stmt]]] = {}  # by block and name
        self._read(body)

    def _read(self, block: Sequence[ast.stmt]) -> None:
        users: defaultdict[str, list[ast.stmt]] = defaultdict(list)
        for statement in block:
            for part in blocks(statement):
                self._read(part)
            found = Counter(node.id for node in ast.walk(statement) if isinstance(node, ast.Name))
            self.count[statement] = found
            for name in found:
                users[name].append(statement)
        self._users[id(block)] = users

    def in_block(self, block: Sequence[ast.stmt], name: str) -> list[ast.stmt]:
        """The statements of a block that use a name."""
        return self._users[id(block)][name]

    def home(self, block: Sequence[ast.stmt], name: str) -> ast.stmt:
        """The first statement with a name, in the innermost block that holds all its uses."""
        users = self.in_block(block, name)
        if len(users) == 1:
            for part in blocks(users[0]):
                if sum(self.count[inner][name] for inner in part) == self.count[users[0]][name]:
                    return self.home(part, name)
        return users[0]


def _loop_variables(module: Module, function: Function, uses: _Uses, parameters: set[str]) -> set[str]:
    """Names that count loops."""
    inside: Counter[str] = Counter()
    loops = {}
    for statement in uses.count:
        name = loop_variable(statement)
        if isinstance(statement, ast.For) and name:
            if name in parameters or name in assigned_in(statement.body) or mentions(statement.iter, {name}):
                module.refuse(statement, f"{name} counts this loop, and is neither a parameter nor assigned in it")
            inside[name] += uses.count[statement][name]
            loops[name] = statement
    for name, statement in loops.items():
        if inside[name] != sum(uses.count[top][name] for top in function.body):
            module.refuse(statement, f"{name} counts this loop, and is used in such loops only")
    return set(loops)


def blocks(statement: ast.stmt) -> Iterator[list[ast.stmt]]:
    """The blocks inside a statement."""
    if isinstance(statement, ast.If | ast.For | ast.While):
        yield statement.body
        yield statement.orelse
