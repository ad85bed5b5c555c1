"""Translate calls: of other compiled functions, conversions, functions of the C library and tuples."""

import ast
import contextlib
import inspect
import math
import re
from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np
from numba import carray, typeof  # type: ignore[attr-defined]
from numba.core.types import Array, BaseTuple, CPointer, Integer, float64, int64

from cranectl.tools.export.inference import Type, result_type
from cranectl.tools.export.operators import Operators
from cranectl.tools.export.sample import pointer_to
from cranectl.tools.export.values import UNARY, Value

C_LIBRARY = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh exp expm1 log log1p log10 sqrt fabs floor ceil copysign "
    "isfinite isnan isinf"
)
_POINTER: Any = CPointer
MATH = {getattr(math, name): name for name in re.findall(r"\w+", C_LIBRARY)}


class Calls(Operators):
    """Translator of expressions with calls and tuples."""

    def visit_Call(self, node: ast.Call) -> Value:  # noqa: N802
        function = self.static(node.func)
        if node.keywords and not inspect.isclass(function):
            raise self.refuse(node, "names arguments")
        if function is carray:
            return self.carray(node)
        if function is pointer_to:
            return self.pointer(node)
        if function is np.empty:
            return self.shaped(node, Value("", float64), node.args[0])
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape" and len(node.args) == 1:
            return self.shaped(node, self.visit(node.func.value), node.args[0])
        values: list[Value] = [self.visit(argument) for argument in node.args]
        if getattr(function, "py_func", None) is not None:
            return self.call(node, function.py_func, values)
        if inspect.isclass(function) and issubclass(function, tuple) and hasattr(function, "_fields"):
            return self.named_tuple(node, function, values)
        if function is len and values[0].length is not None:
            return values[0].length()
        if function in (min, max) and len(values) > 1:
            return self.extreme(node, function, values)
        if function in (int, float, abs) or function in MATH:
            return self.of_number(node, function, values)
        raise self.refuse(node, "calls a function without a translation")

    def visit_Tuple(self, node: ast.Tuple) -> Value:  # noqa: N802
        items = [self.visit(item) for item in node.elts]
        return self.tuple(node, BaseTuple.from_types([item.type for item in items]), items)

    def tuple(self, node: ast.AST, kind: Type, items: list[Value]) -> Value:
        """Return a tuple as a compound literal; arrays bring their lengths."""
        texts = []
        for item in items:
            texts.append(item.text)
            if item.length is not None:
                texts.append(item.length().text)
        joined = ", ".join(texts)
        inner = f"{{{joined}}}" if self.unit.is_uniform(kind) else joined
        return Value(f"({self.unit.c_type(kind, self, node)}){{{inner}}}", kind)

    def of_number(self, node: ast.Call, function: Any, values: list[Value]) -> Value:
        """Return the value of a conversion or of a function of C's library."""
        kind = self.result(node, function, *values)
        value, is_integer = values[0], isinstance(kind, Integer)
        if function in (int, float):
            cast = "int64_t" if is_integer else "double"
            return Value(f"({cast}){value.within(UNARY)}", kind, UNARY, is_natural=value.is_natural)
        if function is abs and is_integer:
            return self.unit.value("abs_int", value)
        with contextlib.suppress(ArithmeticError, ValueError):
            if function in MATH and all(value.constant is not None for value in values):
                # A C compiler may compute it with another rounding than the library of this machine.
                return self.number(node, function(*(value.constant for value in values)), ast.unparse(node))
        text = f"{MATH.get(function, 'fabs')}({', '.join(value.text for value in values)})"
        return Value(f"(int64_t){text}", kind, UNARY) if is_integer else Value(text, kind)

    def extreme(self, node: ast.Call, function: Any, values: list[Value]) -> Value:
        """Return the least or the largest of some numbers."""
        kind = self.result(node, function, *values)
        helper = f"{function.__name__}_{'int' if isinstance(kind, Integer) else 'double'}"
        text = reduce(lambda a, b: self.unit.helper(helper, a, b), (value.text for value in values))
        which = any if function is max else all
        return Value(text, kind, is_natural=which(value.is_natural for value in values))

    def carray(self, node: ast.Call) -> Value:
        """Return an array that begins at a pointer."""
        pointer: Value = self.visit(node.args[0])
        shape = node.args[1]
        if isinstance(shape, ast.Tuple) and len(shape.elts) == 1:
            shape = shape.elts[0]
        length: Value = self.visit(shape)
        if not isinstance(pointer.type, CPointer) or not isinstance(length.type, Integer):
            raise self.refuse(node, "is no array of one dimension at a pointer")
        return pointer._replace(type=Array(pointer.type.dtype, 1, "C"), length=lambda: length)

    def pointer(self, node: ast.Call) -> Value:
        """Return the pointer to the first number of an array."""
        array: Value = self.visit(node.args[0])
        if not isinstance(array.type, Array):
            raise self.refuse(node, "is no array")
        return array._replace(type=_POINTER(array.type.dtype), length=None)

    def shaped(self, node: ast.Call, array: Value, shape: ast.expr) -> Value:
        """Return a vector or a matrix of known size; one without text has memory of its own."""
        parts = shape.elts if isinstance(shape, ast.Tuple) else [shape]
        sizes = [self.visit(part).constant for part in parts]
        if len(sizes) > 2 or not all(isinstance(size, int) and size > 0 for size in sizes):
            raise self.refuse(node, "is no vector or matrix of known size")
        rows = Value(str(sizes[0]), int64, constant=sizes[0], is_natural=True)
        item: Any = getattr(array.type, "dtype", array.type)
        kind = Array(item, len(sizes), "C")
        columns = sizes[1] if len(sizes) == 2 else 0
        return array._replace(type=kind, length=lambda: rows, columns=columns)

    def named_tuple(self, node: ast.Call, function: Any, values: list[Value]) -> Value:
        """Return a new named tuple."""
        named = {str(keyword.arg): self.visit(keyword.value) for keyword in node.keywords}
        try:
            items = list(inspect.signature(function).bind(*values, **named).arguments.values())
        except TypeError:
            raise self.refuse(node, "has wrong arguments") from None
        return self.tuple(node, result_type(typeof(function), tuple(item.type for item in items)), items)

    def call(self, node: ast.Call, function: Callable[..., Any], values: list[Value]) -> Value:
        """Return the value of another compiled function, which is translated too."""
        called = self.unit.function(function, [(v.type, v.is_natural) for v in values], self, node)
        texts = []
        for name, value in zip(called.parameters, values, strict=True):
            texts.append(value.text)
            if name in called.sized:
                assert value.length is not None
                texts.append(value.length().text)
            if name in called.written:
                self.write(node, value)
        if called.written:
            self.effects.append(node)
        return Value(f"{called.name}({', '.join(texts)})", called.returned)


def sequenced(node: ast.AST) -> list[ast.AST]:
    """Return the parts of an expression that C, as Python, computes one after the other."""
    if isinstance(node, ast.UnaryOp):
        return sequenced(node.operand)
    if isinstance(node, ast.BoolOp | ast.IfExp):
        parts = node.values if isinstance(node, ast.BoolOp) else [node.test, node.body, node.orelse]
        return [inner for part in parts for inner in sequenced(part)]
    return [node]
