"""Translate expressions of compiled Python to C, so that every bit of their values stays the same."""

import ast
import contextlib
import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from numba.core.types import Array, BaseTuple, Boolean, CPointer, Float, Integer, boolean, float64, int64

from cranectl.export.inference import Type, common_type, result_type
from cranectl.export.values import (
    AND,
    ATOM,
    CHOICE,
    EQUALITY,
    OR,
    ORDER,
    PRODUCT,
    SUM,
    UNARY,
    Facts,
    Value,
    literal,
)
from cranectl.support.errors import InputError

if TYPE_CHECKING:
    from cranectl.export.unit import Unit

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
MAX_INT = 2**31 - 1  # in C, of 32 bits
ALLOWED = "numbers, items and slices of the five arrays, tuples, if, for, while, functions of math"
_MISSING = object()


class Expressions(ast.NodeVisitor):
    """Translator of the expressions of a function."""

    def __init__(self, unit: "Unit", scope: dict[str, Any], types: dict[str, Type], where: str, first: int):
        self.unit, self.scope, self.types = unit, scope, types
        self.where, self.first = where, first  # file, and line of the function in it
        self.facts = Facts(set())
        self.effects: list[ast.Call] = []  # calls in the present statement that write to arrays

    def refuse(self, node: ast.AST, why: str) -> InputError:
        """Return the error for a part of the source that has no translation."""
        line = self.first + getattr(node, "lineno", 1) - 1
        source = ast.unparse(node).splitlines()[0]
        return InputError(
            f"{self.where}:{line} cannot be exported to C: '{source}' {why}",
            allowed=ALLOWED,
            remedy=f"write line {line} of {self.where} in another way",
        )

    def generic_visit(self, node: ast.AST) -> Any:
        raise self.refuse(node, f"is {type(node).__name__}")

    def result(self, node: ast.AST, function: Any, *values: Value) -> Type:
        """Return the type that Numba infers for a call; raise InputError unless it is a number."""
        kind = result_type(function, tuple(value.type for value in values))
        if not isinstance(kind, Boolean | Integer | Float):
            raise self.refuse(node, f"has the type {kind}, which is no number")
        self.unit.c_type(kind, self, node)
        return kind

    def static(self, node: ast.AST) -> Any:
        """Return the object that a name or an attribute refers to outside of the function, else _MISSING."""
        if isinstance(node, ast.Name) and node.id not in self.types:
            return self.scope.get(node.id, _MISSING)
        if isinstance(node, ast.Attribute):
            owner = self.static(node.value)
            return _MISSING if owner is _MISSING else getattr(owner, node.attr, _MISSING)
        return _MISSING

    def visit_Constant(self, node: ast.Constant) -> Value:
        return self.number(node, node.value, "")

    def number(self, node: ast.AST, value: Any, comment: str) -> Value:
        """Return a constant; its name stands in a comment."""
        note = f" /* {comment} */" if comment else ""
        if isinstance(value, bool):
            return Value(("false", "true")[value] + note, boolean, constant=value)
        if isinstance(value, int):
            text = str(int(value)) if abs(value) <= MAX_INT else f"INT64_C({int(value)})"
            return Value(text + note, int64, UNARY if value < 0 else ATOM, int(value), value >= 0)
        if isinstance(value, float) and not math.isnan(value):
            text, is_exact = literal(value)
            rank = UNARY if text.startswith("-") else ATOM
            return Value(text + (note or ("" if is_exact else f" /* {value!r} */")), float64, rank, value)
        raise self.refuse(node, "is no number")

    def visit_Name(self, node: ast.Name) -> Value:
        if node.id not in self.types:
            return self.number(node, self.static(node), node.id)
        kind, name = self.types[node.id], self.unit.identifier(node.id, self, node)
        if not isinstance(kind, Array | CPointer):
            is_natural = isinstance(kind, Integer) and node.id not in self.facts.signed
            return Value(name, kind, is_natural=is_natural)

        def length() -> Value:
            if (size := self.facts.lengths.get(node.id)) is not None:
                return Value(str(size), int64, constant=size, is_natural=True)
            self.facts.sized.add(node.id)
            return Value(self.size_name(node.id, node), int64, is_natural=True)

        bases = self.facts.bases.get(node.id, frozenset()) | {node.id}
        return Value(name, kind, length=length, bases=bases, columns=self.facts.columns.get(node.id, 0))

    def size_name(self, name: str, node: ast.AST) -> str:
        """Return the name of the variable with the length of an array."""
        size = f"{name}_size"
        if size in self.types:
            raise self.refuse(node, f"needs the name {size}, which is taken")
        return size

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        if (value := self.static(node)) is not _MISSING:
            return self.number(node, value, ast.unparse(node))
        owner: Value = self.visit(node.value)
        fields = getattr(owner.type, "fields", ())
        if node.attr not in fields:
            raise self.refuse(node, "is no field of a named tuple")
        kind, text = owner.type[fields.index(node.attr)], f"{owner.within(ATOM)}.{node.attr}"
        if not isinstance(kind, Array):
            return Value(text, kind)
        return Value(text, kind, length=lambda: Value(text + "_size", int64, is_natural=True), bases=None)

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            array: Value = self.visit(node.value.value)
            place: Value = self.visit(node.slice)
            if array.length is None or place.constant != 0:
                raise self.refuse(node, "is no length of an array of one dimension")
            return array.length()
        owner: Value = self.visit(node.value)
        if isinstance(owner.type, BaseTuple):
            return self.item(node, owner)
        kind = owner.type
        if isinstance(kind, Array) and owner.columns:
            return self.of_matrix(node, owner)
        if not isinstance(kind, Array | CPointer) or (
            isinstance(kind, Array) and (kind.ndim, kind.layout) != (1, "C")
        ):
            raise self.refuse(node, f"is a part of {kind}")
        if isinstance(node.slice, ast.Slice):
            return self.slice(node, node.slice, owner)
        index = self.visit(node.slice)
        if not isinstance(index.type, Integer):
            raise self.refuse(node, "has an index that is no integer")
        text = index.text
        if isinstance(kind, Array) and owner.length is not None and not index.is_natural:
            text = self.unit.helper("index", index.text, owner.length().text)
        return Value(f"{owner.within(ATOM)}[{text}]", kind.dtype, bases=owner.bases)

    def of_matrix(self, node: ast.Subscript, owner: Value) -> Value:
        """Return an item or a row of a matrix, which lies in memory row by row."""
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        places: list[Value] = [self.visit(part) for part in parts]
        if len(places) > 2 or not all(place.is_natural for place in places):
            raise self.refuse(node, "is no item or row of a matrix at a place that is certainly not negative")
        columns = Value(str(owner.columns), int64, constant=owner.columns, is_natural=True)
        start = f"{places[0].within(PRODUCT)} * {columns.text}"
        if len(places) == 1:
            row = Array(owner.type.dtype, 1, "C")
            return Value(f"{owner.text} + {start}", row, SUM, length=lambda: columns, bases=owner.bases)
        text = f"{owner.within(ATOM)}[{start} + {places[1].within(PRODUCT)}]"
        return Value(text, owner.type.dtype, bases=owner.bases)

    def item(self, node: ast.Subscript, owner: Value) -> Value:
        """Return an item of a tuple."""
        index = self.visit(node.slice)
        place, count = index.constant, len(owner.type)
        if place is not None and not -count <= place < count:
            raise self.refuse(node, f"is no item of a tuple of {count}")
        if place is not None:
            return self.part(owner, place % count)
        if not self.unit.is_uniform(owner.type) or not isinstance(index.type, Integer):
            raise self.refuse(node, "has an index that is not known")
        text = index.text if index.is_natural else self.unit.helper("index", index.text, str(count))
        return Value(f"{owner.within(ATOM)}.item[{text}]", owner.type[0])

    def part(self, owner: Value, place: int) -> Value:
        """Return the item of a tuple at a known place."""
        return Value(f"{owner.within(ATOM)}.{self.unit.member(owner.type, place)}", owner.type[place])

    def slice(self, node: ast.Subscript, bounds: ast.Slice, owner: Value) -> Value:
        """Return a part of an array, whose bounds Python keeps within the array."""
        if bounds.step is not None or owner.length is None or isinstance(owner.type, CPointer):
            raise self.refuse(node, "is no slice of an array with step 1")
        whole: Callable[[], Value] = owner.length

        def bound(end: ast.expr | None) -> Value | None:
            if end is None:
                return None
            value: Value = self.visit(end)
            if not isinstance(value.type, Integer):
                raise self.refuse(node, "has a bound that is no integer")
            return value if value.is_natural else self.unit.value("bound", value, whole())

        lower, upper = bound(bounds.lower), bound(bounds.upper)

        def length() -> Value:
            least = lower or Value("0", int64, constant=0, is_natural=True)
            return self.unit.value("span", least, upper or whole(), whole())

        end = ast.unparse(bounds.upper) if bounds.upper else ""
        if lower is None:
            return owner._replace(length=length, end=end)
        return Value(
            f"{owner.within(SUM)} + {lower.within(PRODUCT)}",
            owner.type,
            SUM,
            length=length,
            bases=owner.bases,
            end=end,
        )

    def visit_BinOp(self, node: ast.BinOp) -> Value:
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

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
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

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
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

    def visit_Compare(self, node: ast.Compare) -> Value:
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

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        test, *both = (self.visit(part) for part in (node.test, node.body, node.orelse))
        kind = common_type({value.type for value in both})
        if not isinstance(kind, Boolean | Integer | Float):
            raise self.refuse(node, f"has the type {kind}, which is no number")
        texts = [value.within(OR) for value in (test, *both)]
        is_natural = all(value.is_natural for value in both)
        return Value("{} ? {} : {}".format(*texts), kind, CHOICE, is_natural=is_natural)

    def write(self, node: ast.AST, value: Value) -> None:
        """Note that an array is written to, and so those that it is a part of."""
        if value.bases is None:
            raise self.refuse(node, "writes to an array of a named tuple")
        self.facts.written |= value.bases
