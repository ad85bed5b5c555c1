"""Translate a compiled Python function to a C function, statement by statement."""

import ast
import builtins
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from numba.core.types import Array, Integer, NoneType, int64

from cranectl.tools.export.inference import STEP_TYPES, Inferred, Type, common_type
from cranectl.tools.export.statements import UNBROKEN, Place, Statements, wrap_line
from cranectl.tools.export.values import ATOM, Facts, Value

if TYPE_CHECKING:
    from cranectl.tools.export.unit import Unit

_BLOCKS = ("body", "orelse")


class Function(NamedTuple):
    """A translated function, as its callers need it."""

    name: str
    returned: Type
    parameters: tuple[str, ...]
    sized: frozenset[str]  # parameters that are followed by their length
    written: frozenset[str]  # parameters that are arrays to which it writes


class FunctionTranslator(Statements):
    """Translator of one function for given types of its arguments."""

    def __init__(self, unit: "Unit", function: Callable[..., Any], inferred: Inferred, signed: set[str]):
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
        scope = {**vars(builtins), **function.__globals__, **inspect.getclosurevars(function).nonlocals}
        types = {name: common_type(kinds) for name, kinds in inferred.variables.items()}
        super().__init__(unit, scope, types, function.__code__.co_filename, first)
        if not isinstance(tree, ast.FunctionDef):
            raise self.refuse(tree, "is no function")
        self.tree, self.returned, self.facts = tree, inferred.returned, Facts(set(signed))
        self.parameters = tuple(argument.arg for argument in tree.args.args)
        self.is_step = tuple(types[name] for name in self.parameters) == STEP_TYPES
        nodes = list(ast.walk(tree))
        names = [node for node in nodes if isinstance(node, ast.Name)]
        added = [node.target for node in nodes if isinstance(node, ast.AugAssign)]
        self.loaded = {node.id for node in names if isinstance(node.ctx, ast.Load) or node in added}
        self.stores = [node.id for node in names if isinstance(node.ctx, ast.Store)]
        targets = [node.target for node in nodes if isinstance(node, ast.For)]
        loops = [target.id for target in targets if isinstance(target, ast.Name)]
        self.counters = {name for name in loops if self.stores.count(name) == loops.count(name)}
        self.places = self._find_places()
        if outside := self.counters & set(self.places):  # these are assigned to in each turn of their loops
            self.counters -= outside
            self.places = self._find_places()

    def _find_places(self) -> dict[str, list[tuple[Place, ast.Name]]]:
        """Return where each variable stands, apart from counters within their loops."""
        places: dict[str, list[tuple[Place, ast.Name]]] = {}

        def visit(block: list[ast.stmt], outer: Place, counters: frozenset[str]) -> None:
            for index, statement in enumerate(block):
                place = (*outer, (id(block), index))
                own = counters
                if isinstance(statement, ast.For) and isinstance(statement.target, ast.Name):
                    own = counters | ({statement.target.id} & self.counters)
                for node in _outside_blocks(statement):
                    if isinstance(node, ast.Name) and node.id in self.types and node.id not in own:
                        places.setdefault(node.id, []).append((place, node))
                for name in _BLOCKS:
                    if isinstance(statement, ast.If | ast.For | ast.While):
                        visit(getattr(statement, name), place, own)

        visit(self.tree.body, (), frozenset())
        return places

    def translate(self, name: str, *, is_entry: bool = False) -> tuple[Function, str]:
        """Return the function as its callers need it, and its text; other files can call an entry."""
        while True:
            known = self.facts.count()
            self.begin()
            self.block(self.tree.body)
            if self.facts.count() == known:
                break
        self._use_all()
        body = "\n".join([*self.hoisted, *self.lines])
        names = frozenset(self.parameters)
        sized, written = names & self.facts.sized, names & self.facts.written
        declarations, unused = [], []
        for parameter in self.parameters:
            label = self.unit.identifier(parameter, self, self.tree)
            is_output = parameter in written or (is_entry and parameter in self.parameters[3:])
            declarations.append(self.declaration(label, self.types[parameter], is_constant=not is_output))
            if parameter in sized:
                declarations.append(f"int64_t {self.size_name(parameter, self.tree)}")
            if not re.search(rf"\b{label}\b", body):
                unused.append(f"    (void){label};")
        has_value = not isinstance(self.returned, NoneType)
        returned = self.unit.c_type(self.returned, self, self.tree) if has_value else "void"
        static = "" if is_entry else "static "
        joined = ", ".join(declaration.replace(" ", UNBROKEN) for declaration in declarations)
        head = wrap_line(f"{static}{returned} {name}({joined or 'void'})", "")
        text = "\n".join([head, "{", *unused, body, "}"])
        return Function(name, self.returned, self.parameters, sized, written), self._comment() + text

    def _use_all(self) -> None:
        """Mark variables that C does not need, such as an array of which only the length is used."""
        for name in sorted(self.declared.difference(self.parameters)):
            label = self.unit.identifier(name, self, self.tree)
            places = [k for k, line in enumerate(self.lines) for _ in re.findall(rf"\b{label}\b", line)]
            if len(places) == 1:
                line = self.lines[places[0]]
                indent = line[: len(line) - len(line.lstrip())]
                self.lines[places[0]] += f"\n{indent}(void){label};"

    def _comment(self) -> str:
        """Return the docstring of the function as a comment."""
        module, said = self.scope.get("__name__", ""), ast.get_docstring(self.tree) or ""
        lines = [f"{module}.{self.tree.name}", "", *said.replace("*/", "* /").splitlines()]
        return "/* " + "\n".join(f" * {line}".rstrip() for line in lines)[3:] + " */\n"

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


def _outside_blocks(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield the nodes of a statement without the statements in its blocks."""
    for name, value in ast.iter_fields(statement):
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST) and not (name in _BLOCKS and isinstance(node, ast.stmt)):
                yield from ast.walk(node)
