"""Translate loops to C."""

import ast

from numba.core.types import Array, Integer, int64

from cranectl.export.statements import Statements
from cranectl.export.values import ATOM, Value


class Loops(Statements):
    """Translator of statements with loops."""

    def visit_While(self, node: ast.While) -> None:  # noqa: N802
        if node.orelse:
            raise self.refuse(node, "has an else")
        self._nested(f"while ({self.expression(node.test).text}) {{", node.body)
        self.line("}")

    def visit_For(self, node: ast.For) -> None:  # noqa: N802
        if node.orelse or not isinstance(node.target, ast.Name):
            raise self.refuse(node, "has an else or several targets")
        name = node.target.id
        label, is_counter = self.unit.identifier(name, self, node), name in self.counters
        if isinstance(node.iter, ast.Call) and self.static(node.iter.func) is range:
            counter = label if is_counter else f"{label}_place"
            head, value = self._range(node.iter, counter)
            if is_counter and not value.is_natural:
                self.facts.signed.add(name)
        else:
            array, counter = self.expression(node.iter), f"{label}_place"
            if array.length is None or not isinstance(array.type, Array):
                raise self.refuse(node.iter, "is neither a range nor an array")
            head = f"for (int64_t {counter} = 0; {counter} < {array.length().text}; {counter}++) {{"
            value = Value(f"{array.within(ATOM)}[{counter}]", array.type.dtype)
        if counter != label and counter in self.types:
            raise self.refuse(node, f"needs the name {counter}, which is taken")
        self.line(head)
        self.depth += 1
        if counter != label and is_counter:
            self.line(f"const {self.declaration(label, value.type, is_constant=False)} = {value.text};")
        elif counter != label:
            self._assign_name(node.target, value)
        self.block(node.body)
        self.depth -= 1
        self.line("}")

    def _range(self, call: ast.Call, counter: str) -> tuple[str, Value]:
        """Return the head of a loop over a range, whose end is computed once, and its counter."""
        zero, one = Value("0", int64, constant=0, is_natural=True), Value("1", int64, constant=1)
        bounds = [self.expression(argument) for argument in call.args]
        start, stop, step = (zero, *bounds, one) if len(bounds) == 1 else (*bounds, one)[:3]
        if not step.constant or any(not isinstance(bound.type, Integer) for bound in (start, stop)):
            raise self.refuse(call, "is no range of integers with a constant step")
        up = step.constant > 0
        is_natural = start.is_natural if up else stop.is_natural or stop.constant == -1
        end, first = stop.text, f"int64_t {counter} = {start.text}"
        bound = call.args[min(1, len(bounds) - 1)]
        is_fixed = isinstance(bound, ast.Name) and self.stores.count(bound.id) == (
            bound.id not in self.parameters
        )
        if stop.constant is None and not is_fixed:
            end = f"{counter}_end"
            first = f"{first}, {end} = {stop.text}"
        advance = {1: f"{counter}++", -1: f"{counter}--"}.get(step.constant, f"{counter} += {step.constant}")
        head = f"for ({first}; {counter} {'<' if up else '>'} {end}; {advance}) {{"
        return head, Value(counter, int64, is_natural=is_natural)
