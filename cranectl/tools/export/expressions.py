"""Translate expressions of compiled Python to C, so that every bit of their values stays the same."""

import ast
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from numba.core.types import Array, BaseTuple, Boolean, CPointer, Float, Integer, boolean, float64, int64

from cranectl.support import InputError
from cranectl.tools.export.inference import Type, result_type
from cranectl.tools.export.values import ATOM, PRODUCT, SUM, UNARY, Facts, Value, literal

if TYPE_CHECKING:
    from cranectl.tools.export.unit import Unit

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

    def write(self, node: ast.AST, value: Value) -> None:
        """Note that an array is written to, and so those that it is a part of."""
        if value.bases is None:
            raise self.refuse(node, "writes to an array of a named tuple")
        self.facts.written |= value.bases
