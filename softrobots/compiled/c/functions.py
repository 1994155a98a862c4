"""Functions of the kernel language in C: statements, declarations and the order in which C computes."""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Iterable, Sequence

from softrobots.compiled.c.expressions import ARITHMETIC, SUM, Part, Scope, as_float
from softrobots.compiled.c.kernel_language import WORDS, Function
from softrobots.compiled.c.local_variables import assigned_in, mentions, plan_locals

C_TYPES = {"none": "void", "int": "int", "bool": "int", "float": "double"}
"""Types in C."""
WIDTH = 116
"""Characters of a line, where it can be helped."""
_RESERVED = """
auto break case char const continue default do double else enum extern float for goto if inline int long register restrict
return short signed sizeof static struct switch typedef union unsigned void volatile while asm typeof linux unix
""".split()  # noqa: SIM905 (readable)
_INDENT = "    "


def prototype(function: Function, scope: Scope) -> str:
    """Declaration of a function, without the semicolon."""
    shown = []
    for parameter in function.parameters:
        name = scope.local_name(parameter.name)
        constant = "" if parameter.written else "const "
        shown.append(f"{constant}double *{name}" if parameter.kind == "array" else f"{C_TYPES[parameter.kind]} {name}")
    return f"{C_TYPES[function.returns]} {scope.prefix}{function.name}({', '.join(shown) or 'void'})"


def comment(lines: Iterable[str]) -> str:
    """A comment in C; what would end it or mean something else in it is spaced out."""
    made = []
    for line in lines:
        plain = line.encode("ascii", "backslashreplace").decode().replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
        indent = " " * (len(plain) - len(plain.lstrip()))
        made += textwrap.wrap(plain, WIDTH - 3, subsequent_indent=indent, break_on_hyphens=False) or [""]
    if len(made) == 1:
        return f"/* {made[0]} */"
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in made), " */"])


def wrapped(line: str) -> list[str]:
    """A line of C in lines that are not too long; C takes a new line wherever it takes a space, a reader not before an `*`."""
    indent = line[: len(line) - len(line.lstrip())]
    made = textwrap.wrap(
        line.replace("double *", "double\0*"),
        WIDTH - 3,  # declarations stand in comments, too
        subsequent_indent=indent + 2 * _INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [one.replace("\0", " ") for one in made] or [line]


class FunctionWriter:
    """Writes one function."""

    def __init__(self, function: Function, scope: Scope) -> None:
        """Prepare to write `function`; `scope` is that of the module, with what is defined before the function."""
        self.function = function
        self.scope = scope
        self._module = scope.module
        self._plan = plan_locals(scope.module, function)
        self._declared: set[str] = set()
        self._taken = {scope.prefix + name for name in (*scope.module.functions, *scope.module.constants, *WORDS)}
        self._taken.update(_RESERVED)
        self._lines: list[str | tuple[str, str]] = []  # a pair is the declaration of a name: indentation and name
        parameters = [parameter.name for parameter in function.parameters]
        for name in dict.fromkeys((*parameters, *self._plan.stores)):
            if name in WORDS:
                self._module.refuse(function.node, f"no parameter and no local is called {name}")
            scope.c_names[name] = self._free(name)
        scope.kinds.update({parameter.name: parameter.kind for parameter in function.parameters})

    def text(self, *, external: bool) -> str:
        """The function in C.

        Args:
            external: Whether it can be called from other files.

        Raises:
            ParameterError: If a statement is outside the kernel language.
        """
        for parameter in self.function.parameters:
            if parameter.name not in self._plan.read and parameter.name not in self._plan.stores:
                self._lines.append(f"{_INDENT}(void){self.scope.local_name(parameter.name)};")
        self._block(self.function.body, _INDENT, top=True)
        if self.function.returns != "none" and not _ends(self.function.body):
            self._module.refuse(self.function.node, f"{self.function.name} returns a value on every way through it")
        lines = comment(self.function.docstring.splitlines()).splitlines() if self.function.docstring else []
        lines += [*wrapped(("" if external else "static ") + prototype(self.function, self.scope)), "{"]
        for line in self._lines:
            lines += wrapped(line) if isinstance(line, str) else self._zero(*line)
        return "\n".join([*lines, "}"])

    def _free(self, name: str) -> str:
        while name in self._taken or name.startswith("__") or (name[0] == "_" and name[1:2].isupper()):
            name = name.lstrip("_") + "_"
        if not name.isascii():
            self._module.refuse(self.function.node, f"names are ASCII; {name!r} is not")
        self._taken.add(name)
        return name

    def _zero(self, indent: str, name: str) -> list[str]:
        kind, shown = self.scope.kinds[name], self.scope.local_name(name)
        lines = [f"{indent}{C_TYPES[kind]} {shown} = {'0.0' if kind == 'float' else '0'};"]
        return lines if name in self._plan.read else [*lines, f"{indent}(void){shown};"]

    def _block(self, block: Sequence[ast.stmt], indent: str, *, top: bool = False) -> None:
        for statement in block:
            if top:
                self._lines += [(indent, name) for name in self._plan.before.get(statement, ())]
            self._statement(statement, indent)

    def _statement(self, node: ast.stmt, indent: str) -> None:
        match node:
            case ast.Pass():
                pass
            case ast.Break():
                self._lines.append(f"{indent}break;")
            case ast.Continue():
                self._lines.append(f"{indent}continue;")
            case ast.Return(value=value):
                self._return(node, value, indent)
            case ast.Expr(value=ast.Call() as called):
                self._ordered(node)
                self._lines.append(f"{indent}{self._bare_call(called)};")
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call(func=ast.Name(id="zeros")) as made):
                self._local_array(node, name, made, indent)
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                self._ordered(node)
                self._assign(node, name, self.scope.value(value), "=", indent)
            case ast.Assign(targets=[ast.Subscript() as target], value=value):
                self._ordered(node)
                self._store(node, target, self.scope.value(value), "=", indent)
            case ast.AugAssign(target=target, op=operator, value=value):
                self._ordered(node)
                self._update(node, target, operator, value, indent)
            case ast.If():
                self._branch(node, indent, "if")
            case ast.While(test=test, body=body, orelse=[]):
                self._ordered(test)
                always = isinstance(test, ast.Constant) and test.value is True
                self._lines.append(f"{indent}while ({'1' if always else self.scope.condition(test).text}) {{")
                self._block(body, indent + _INDENT)
                self._lines.append(f"{indent}}}")
            case ast.For(
                target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=limits, keywords=[]), orelse=[]
            ):
                self._for(node, name, limits, indent)
            case _:
                self._module.refuse(
                    node,
                    "statements are name = value, array[index] = value, name = zeros(N), += -= *= /=, calls, if, while, "
                    "for name in range(...), break, continue, return and pass",
                )

    def _bare_call(self, called: ast.Call) -> str:
        made = self.scope.call(called)
        return made.text if made.kind == "none" else f"(void){made.text}"

    def _return(self, node: ast.stmt, value: ast.expr | None, indent: str) -> None:
        wanted = self.function.returns
        if (value is None) != (wanted == "none"):
            self._module.refuse(
                node, f"{self.function.name} returns {'nothing' if wanted == 'none' else f'a value ({wanted})'}"
            )
        if value is None:
            self._lines.append(f"{indent}return;")
            return
        self._ordered(node)
        made = self.scope.fitting(node, self.scope.value(value), wanted, f"the value of {self.function.name}")
        self._lines.append(f"{indent}return {made.text};")

    def _assign(self, node: ast.stmt, name: str, part: Part, sign: str, indent: str) -> None:
        known = self.scope.kinds.get(name)
        if known == "array":
            self._module.refuse(node, f"{name} is an array: only its elements are assigned")
        made = self.scope.fitting(node, part, known or part.kind, name)
        shown, declaration = self.scope.local_name(name), ""
        if known is None:
            self.scope.kinds[name] = part.kind
            if name in self._plan.with_assignment:
                declaration = f"{'const ' if self._plan.stores[name] == 1 else ''}{C_TYPES[part.kind]} "
        self._lines.append(f"{indent}{declaration}{shown} {sign} {made.text};")
        if declaration and name not in self._plan.read:
            self._lines.append(f"{indent}(void){shown};")

    def _store(self, node: ast.stmt, target: ast.Subscript, part: Part, sign: str, indent: str) -> None:
        element = self.scope.element(target, store=True)
        made = self.scope.fitting(node, part, "float", element.text)
        self._lines.append(f"{indent}{element.text} {sign} {made.text};")

    def _update(self, node: ast.AugAssign, target: ast.expr, operator: ast.operator, value: ast.expr, indent: str) -> None:
        if isinstance(target, ast.Subscript):
            before = self.scope.element(target, store=True)
        elif isinstance(target, ast.Name):
            before = self.scope.value(ast.copy_location(ast.Name(target.id, ast.Load()), target))
        else:
            self._module.refuse(node, "what is updated is a name or an element of an array")
        after = self.scope.value(value)
        result = self.scope.arithmetic(node, before, operator, after)
        sign = "="
        if type(operator) in ARITHMETIC:
            sign = f"{ARITHMETIC[type(operator)][0]}="
            result = (as_float(after) if result.kind == "float" else after)._replace(kind=result.kind)
        if isinstance(target, ast.Name):
            self._assign(node, target.id, result, sign, indent)
        else:
            self._store(node, target, result, sign, indent)

    def _local_array(self, node: ast.stmt, name: str, made: ast.Call, indent: str) -> None:
        size = self.scope.known_int(made.args[0]) if len(made.args) == 1 and not made.keywords else None
        if size is None or size < 1:
            self._module.refuse(node, "a local array is made by zeros(N) with a positive int N, written out or a constant")
        if name in self.scope.kinds or name not in self._plan.with_assignment or self._plan.stores[name] != 1:
            self._module.refuse(node, f"{name}, a local array, is assigned once, in the block that uses it and before its use")
        self.scope.kinds[name], self.scope.sizes[name] = "array", size
        shown, count = self.scope.local_name(name), self.scope.value(made.args[0]).text
        self._lines.append(f"{indent}double {shown}[{count}];")
        self._lines.append(f"{indent}{self.scope.global_name('clear_array')}({shown}, {count});")

    def _branch(self, node: ast.If, indent: str, word: str) -> None:
        self._ordered(node.test)
        self._lines.append(f"{indent}{word} ({self.scope.condition(node.test).text}) {{")
        self._block(node.body, indent + _INDENT)
        match node.orelse:
            case []:
                self._lines.append(f"{indent}}}")
            case [ast.If() as other]:
                self._branch(other, indent, "} else if")
            case _:
                self._lines.append(f"{indent}}} else {{")
                self._block(node.orelse, indent + _INDENT)
                self._lines.append(f"{indent}}}")

    def _for(self, node: ast.For, name: str, limits: Sequence[ast.expr], indent: str) -> None:
        step = self.scope.known_int(limits[2]) if len(limits) == 3 else 1
        if not 1 <= len(limits) <= 3 or not step:
            self._module.refuse(node, "a range has one to three ints; the third is written out or a constant, and not zero")
        parts = [self.scope.value(limit) for limit in limits[:2]]
        if any(part.kind != "int" for part in parts):
            self._module.refuse(node, "a range is of ints")
        start, stop = ("0" if len(parts) == 1 else parts[0].text), parts[-1]
        bound = stop.within(SUM)
        if mentions(limits[len(parts) - 1], assigned_in(node.body)) or "(" in stop.text or "[" in stop.text:
            bound = self._free(f"{name}_stop")  # Python looks at it once
            self._lines.append(f"{indent}const int {bound} = {stop.text};")
        counter = self.scope.local_name(name)
        self.scope.kinds[name] = "int"
        change = {1: f"++{counter}", -1: f"--{counter}"}.get(step, f"{counter} {'+' if step > 0 else '-'}= {abs(step)}")
        compared = f"{counter} {'<' if step > 0 else '>'} {bound}"
        self._lines.append(f"{indent}for (int {counter} = {start}; {compared}; {change}) {{")
        self._block(node.body, indent + _INDENT)
        self._lines.append(f"{indent}}}")

    def _ordered(self, node: ast.AST) -> None:
        """Refuse what depends on the order of computation: Python goes from left to right, C as it likes.

        An array that a call changes may be read by the same statement in the arguments of the call only.
        """
        if isinstance(node, ast.BoolOp):  # `and` and `or` go from left to right in C, too
            for value in node.values:
                self._ordered(value)
            return
        parts = list(ast.walk(node))
        calls = [part for part in parts if isinstance(part, ast.Call) and self._called(part).writes]
        if not calls:
            return
        inside = {id(part) for part in ast.walk(calls[0])}
        for part in parts:
            reads = isinstance(part, ast.Subscript) and isinstance(part.ctx, ast.Load)
            reads = reads or (isinstance(part, ast.Call) and any(one.kind == "array" for one in self._called(part).parameters))
            reads = reads or (isinstance(part, ast.AugAssign) and isinstance(part.target, ast.Subscript))
            if len(calls) > 1 or (reads and id(part) not in inside):
                self._module.refuse(calls[0], "a call that writes an array stands in a statement without other array accesses")

    def _called(self, call: ast.Call) -> Function:
        nothing = Function("", (), "none", "", (), self.function.node)
        return self.scope.earlier.get(call.func.id, nothing) if isinstance(call.func, ast.Name) else nothing


def _ends(block: Sequence[ast.stmt]) -> bool:
    """Whether every way through a block ends in a return."""
    match block[-1] if block else None:
        case ast.Return():
            return True
        case ast.If(body=body, orelse=otherwise):
            return _ends(body) and _ends(otherwise)
        case ast.While(test=ast.Constant(value=True), body=body):
            return not any(isinstance(inner, ast.Break) for statement in body for inner in ast.walk(statement))
    return False
