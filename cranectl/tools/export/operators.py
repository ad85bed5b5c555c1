"""Translate operators, comparisons and choices to C."""

import ast
import contextlib
import operator
from typing import Any

from numba.core.types import Boolean, Float, Integer, boolean, float64

from cranectl.tools.export.expressions import Expressions
from cranectl.tools.export.inference import common_type
from cranectl.tools.export.values import AND, ATOM, CHOICE, EQUALITY, OR, ORDER, PRODUCT, SUM, UNARY, Value

ARITHMETIC: dict[type, tuple[Any, str, int]] = {
    ast.Add: (operator.add, "+", SUM),
    ast.Sub: (operator.sub, "-", SUM),
    ast.Mult: (operator.mul, "*", PRODUCT),
    ast.Div: (operator.truediv, "/", PRODUCT),
    ast.FloorDiv: (operator.floordiv, "cranectl_floor_divide", ATOM),
    ast.Mod: (operator.mod, "cranectl_modulo", ATOM),
    ast.Pow: (operator.pow, "pow", ATOM),
}
COMPARISONS: dict[type, tuple[Any, str, int]] = {
    ast.Lt: (operator.lt, "<", ORDER),
    ast.LtE: (operator.le, "<=", ORDER),
    ast.Gt: (operator.gt, ">", ORDER),
    ast.GtE: (operator.ge, ">=", ORDER),
    ast.Eq: (operator.eq, "==", EQUALITY),
    ast.NotEq: (operator.ne, "!=", EQUALITY),
}
MAX_EXPONENT = 16  # of a constant power


class Operators(Expressions):
    """Translator of expressions with operators."""

    def visit_BinOp(self, node: ast.BinOp) -> Value:  # noqa: N802
        return self.arithmetic(node, self.visit(node.left), node.op, self.visit(node.right))

    def arithmetic(self, node: ast.AST, left: Value, op: ast.operator, right: Value) -> Value:
        """Return the value of an operator as Numba computes it."""
        if type(op) not in ARITHMETIC:
            raise self.refuse(node, "has an operator without a translation")
        function, symbol, rank = ARITHMETIC[type(op)]
        if isinstance(op, ast.Pow):
            return self.power(node, left, right)
        kind = self.result(node, function, left, right)
        constant = None
        with contextlib.suppress(ArithmeticError):
            if left.constant is not None and right.constant is not None:
                constant = function(left.constant, right.constant)
        is_natural = left.is_natural and right.is_natural and not isinstance(op, ast.Sub | ast.Div)
        if rank == ATOM:
            if not isinstance(kind, Integer):
                raise self.refuse(node, "divides numbers with a fraction")
            if is_natural and right.constant:  # then C's operators do the same
                symbol = "/" if isinstance(op, ast.FloorDiv) else "%"
                text = f"{left.within(PRODUCT)} {symbol} {right.within(UNARY)}"
                return Value(text, kind, PRODUCT, constant, is_natural)
            return self.unit.value(symbol.removeprefix("cranectl_"), left, right)._replace(
                constant=constant, is_natural=is_natural
            )
        if isinstance(op, ast.Div) and isinstance(left.type, Integer) and isinstance(right.type, Integer):
            left = Value(f"(double){left.within(UNARY)}", float64, UNARY)
        text = f"{left.within(rank)} {symbol} {right.within(rank + 1)}"
        return Value(text, kind, rank, constant, is_natural)

    def power(self, node: ast.AST, base: Value, exponent: Value) -> Value:
        """Return a power, which Numba computes by products if the exponent is a constant integer."""
        if not isinstance(base.type, Float):
            raise self.refuse(node, "is a power of an integer")
        if exponent.constant is None and isinstance(exponent.type, Float):
            return Value(f"pow({base.text}, {exponent.text})", float64)
        if not isinstance(exponent.type, Integer) or not 0 <= (exponent.constant or -1) <= MAX_EXPONENT:
            raise self.refuse(node, f"has an exponent that is no constant from 1 to {MAX_EXPONENT}")
        return Value(self.unit.helper(f"power_{exponent.constant}", base.text), float64)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:  # noqa: N802
        value = self.visit(node.operand)
        if isinstance(node.op, ast.Not) and value.constant is not None:
            return self.number(node, not value.constant, "")
        if isinstance(node.op, ast.Not):
            return Value(f"!{value.within(UNARY)}", self.result(node, operator.not_, value), UNARY)
        if not isinstance(node.op, ast.USub):
            raise self.refuse(node, "has an operator without a translation")
        kind = self.result(node, operator.neg, value)
        constant = None if value.constant is None else -value.constant
        return Value(f"-{value.within(ATOM)}", kind, UNARY, constant)

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:  # noqa: N802
        is_and, values = isinstance(node.op, ast.And), []
        for part in node.values:
            value: Value = self.visit(part)
            if not isinstance(value.type, Boolean):
                raise self.refuse(node, "joins what is neither true nor false")
            if value.constant is None:
                values.append(value)
            elif value.constant != is_and:
                return value
        if len(values) < 2:
            return values[0] if values else self.number(node, is_and, "")
        symbol, rank = (" && ", AND) if is_and else (" || ", OR)
        return Value(symbol.join(value.within(EQUALITY) for value in values), boolean, rank)

    def visit_Compare(self, node: ast.Compare) -> Value:  # noqa: N802
        values, texts, rank = [self.visit(value) for value in (node.left, *node.comparators)], [], AND
        known: list[bool | None] = []
        for left, op, right in zip(values, node.ops, values[1:], strict=False):
            if type(op) not in COMPARISONS:
                raise self.refuse(node, "has a comparison without a translation")
            function, symbol, rank = COMPARISONS[type(op)]
            self.result(node, function, left, right)
            is_known = left.constant is not None and right.constant is not None
            known.append(function(left.constant, right.constant) if is_known else None)
            texts.append(f"{left.within(rank + 1)} {symbol} {right.within(rank + 1)}")
        constant = None if None in known else all(known)
        return Value(" && ".join(texts), boolean, rank if len(texts) == 1 else AND, constant)

    def visit_IfExp(self, node: ast.IfExp) -> Value:  # noqa: N802
        parts: list[Value] = [self.visit(part) for part in (node.test, node.body, node.orelse)]
        test, *both = parts
        if test.constant is not None and both[0].type == both[1].type:
            return both[0] if test.constant else both[1]
        kind = common_type({value.type for value in both})
        if not isinstance(kind, Boolean | Integer | Float):
            raise self.refuse(node, f"has the type {kind}, which is no number")
        texts = [value.within(OR) for value in parts]
        is_natural = all(value.is_natural for value in both)
        return Value("{} ? {} : {}".format(*texts), kind, CHOICE, is_natural=is_natural)
