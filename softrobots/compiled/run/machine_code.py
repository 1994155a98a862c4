"""Functions in the kernel language for functions that numba compiles: numba only calls what LLVM makes of their text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from llvmlite import binding, ir
from numba.core import types
from numba.core.cgutils import get_or_insert_function
from numba.core.codegen import JITCodeLibrary
from numba.core.errors import TypingError
from numba.extending import intrinsic

from softrobots.compiled.translate.llvm import functions_of_text, to_llvm
from softrobots.compiled.translate.llvm_expressions import TYPES

_OF_NUMBA = {"float": types.float64, "int": types.int64, "bool": types.boolean, "none": types.void}


class _Linked(JITCodeLibrary):
    """Code that is compiled with the code of each function that calls it, not by itself."""

    def finalize(self) -> None:
        """Leave it as it is."""
        self._finalized = True


def lowered(text: str, constants: Mapping[str, Any], name: str, *given: types.Type) -> Any:
    """Return what an intrinsic of numba returns: the signature of a function in the kernel language, and how it is called.

    Args:
        text: Text with the function, and with all functions that it calls.
        constants: Numbers and tables by name, and `__name__`, which tells this text from others.
        name: The function.
        *given: Types of the arguments.

    Raises:
        TypingError: If an array is not of floats, flat and contiguous.
    """
    function = functions_of_text(text)[name]
    kinds = [parameter.kind for parameter in function.parameters]
    for one, kind in zip(given, kinds, strict=True):
        if kind == "array" and one not in (types.float64[::1], types.Array(types.float64, 1, "C", readonly=True)):
            raise TypingError(f"arrays of {name} are of floats, flat and contiguous; this is {one}")
    taken = [one if kind == "array" else _OF_NUMBA[kind] for one, kind in zip(given, kinds, strict=True)]

    def build(context: Any, builder: ir.IRBuilder, called: Any, values: Sequence[ir.Value]) -> ir.Value:
        prefix = f"{constants['__name__']}."
        module = binding.parse_assembly(to_llvm(text, constants, name, prefix))
        module.verify()
        library = _Linked(context.codegen(), name)  # type: ignore[no-untyped-call]
        library.add_llvm_module(module)  # type: ignore[no-untyped-call]
        context.active_code_library.add_linking_library(library)
        shape = ir.FunctionType(TYPES[function.returns], [TYPES[kind] for kind in kinds])
        passed = [
            context.make_array(of)(context, builder, value).data if kind == "array" else value
            for value, of, kind in zip(values, called.args, kinds, strict=True)
        ]
        result = builder.call(get_or_insert_function(builder.module, shape, prefix + name), passed)
        return context.get_dummy_value() if function.returns == "none" else result

    return _OF_NUMBA[function.returns](*taken), build


def _of_llvm(name: str) -> Any:
    """Return a function of LLVM for functions that numba compiles itself."""

    def typed(typing: Any, x: types.Type) -> Any:
        def build(context: Any, builder: ir.IRBuilder, called: Any, values: Sequence[ir.Value]) -> ir.Value:
            shape = ir.FunctionType(TYPES["float"], [TYPES["float"]])
            return builder.call(get_or_insert_function(builder.module, shape, f"llvm.{name}.f64"), values)

        return types.float64(types.float64), build

    return intrinsic(typed)


fabs, floor, sqrt = _of_llvm("fabs"), _of_llvm("floor"), _of_llvm("sqrt")


@intrinsic
def where(typing: Any, condition: types.Type, a: types.Type, b: types.Type) -> Any:
    """Return `a` where the condition holds, else `b`: a select from the start, which can be vectorised, unlike a branch."""
    single = types.float64(types.boolean, types.float64, types.float64)
    return single, lambda context, builder, called, values: builder.select(*values)
