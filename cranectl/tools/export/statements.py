"""Translate statements of compiled Python to C."""

import ast
import re
import textwrap

from numba.core.types import Array, BaseTuple, CPointer, Integer, NoneType

from cranectl.tools.export.calls import Calls, sequenced
from cranectl.tools.export.inference import Type
from cranectl.tools.export.operators import ARITHMETIC
from cranectl.tools.export.values import ATOM, Value

C_LINE_WIDTH = 110  # of lines in C
UNBROKEN = "\xa0"  # a space at which no line is broken
Place = tuple[tuple[int, int], ...]  # of a statement: block and index in it, from the outermost block


def wrap_line(text: str, indent: str) -> str:
    """Return a line of C, broken where it is too long, but not within comments."""
    kept = re.sub(r" /\*.*?\*/", lambda match: match[0].replace(" ", UNBROKEN), text)
    lines = textwrap.wrap(kept, C_LINE_WIDTH, initial_indent=indent, subsequent_indent=indent + "    ",
                          break_long_words=False, break_on_hyphens=False)  # fmt: skip
    return "\n".join(lines).replace(UNBROKEN, " ")


class Statements(Calls):
    """Translator of the statements of a function."""

    tree: ast.FunctionDef
    returned: Type
    parameters: tuple[str, ...]
    is_step: bool  # whether it has the arguments of a step, which are certainly different arrays
    loaded: set[str]  # variables that are read
    stores: list[str]  # variables that are assigned to, as often as that is done
    counters: set[str]  # of loops, without other uses
    places: dict[str, list[tuple[Place, ast.Name]]]  # of all other variables

    def begin(self) -> None:
        """Forget the text, for another translation that knows more facts."""
        self.lines: list[str] = []
        self.declared = set(self.parameters)
        self.hoisted: list[str] = []  # declarations of variables that several blocks share
        self.temporaries, self.depth = 0, 1

    def declaration(self, name: str, kind: Type, *, is_constant: bool) -> str:
        """Return the declaration of a variable; `is_constant` is of the items of an array."""
        if isinstance(kind, Array | CPointer):
            return f"{'const ' if is_constant else ''}{self.unit.c_type(kind.dtype, self, self.tree)} *{name}"
        return f"{self.unit.c_type(kind, self, self.tree)} {name}"

    def line(self, text: str) -> None:
        """Append a line of C, broken where it is too long."""
        self.lines.append(wrap_line(text, "    " * self.depth))

    def block(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            self.effects = []
            self.statement = statement
            self.visit(statement)

    def _nested(self, opening: str, statements: list[ast.stmt]) -> None:
        self.line(opening)
        self.depth += 1
        self.block(statements)
        self.depth -= 1

    def expression(self, node: ast.expr) -> Value:
        """Return an expression in which nothing is written before something else is read."""
        value: Value = self.visit(node)
        if any(effect not in sequenced(node) for effect in self.effects):
            raise self.refuse(node, "calls, within an expression, a function that writes to an array")
        return value

    def temporary(self, value: Value) -> Value:
        """Keep a number or a tuple in a new constant."""
        self.temporaries += 1
        name = f"value_{self.temporaries}"
        if value.length is not None or name in self.types:
            raise self.refuse(self.statement, f"needs the name {name}, or keeps an array")
        self.line(f"const {self.unit.c_type(value.type, self, self.statement)} {name} = {value.text};")
        return Value(name, value.type, is_natural=value.is_natural)

    def visit_Assign(self, node: ast.Assign) -> None:  # noqa: N802
        if len(node.targets) == 1 and isinstance(node.targets[0], ast.Tuple):
            self._unpack(node.targets[0].elts, node.value)
            return
        value = self.expression(node.value)
        if (len(node.targets) > 1 and value.constant is None) or (
            self.effects and isinstance(node.targets[0], ast.Subscript)
        ):
            value = self.temporary(value)
        for target in node.targets:
            self._assign(target, value)

    def _unpack(self, targets: list[ast.expr], source: ast.expr) -> None:
        """Assign to several targets; all values are computed before the first assignment."""
        if (
            isinstance(source, ast.IfExp)
            and isinstance(source.body, ast.Tuple)
            and isinstance(source.orelse, ast.Tuple)
        ):
            pairs = zip(source.body.elts, source.orelse.elts, strict=False)
            source = ast.Tuple(
                [ast.copy_location(ast.IfExp(source.test, a, b), source) for a, b in pairs], ast.Load()
            )
        if isinstance(source, ast.Tuple):
            values = [self.expression(item) for item in source.elts]
            stored = {target.id for target in targets[:-1] if isinstance(target, ast.Name)}
            read = [node for item in source.elts[1:] for node in ast.walk(item)]
            is_array = any(not isinstance(target, ast.Name) for target in targets[:-1])
            if self.effects or any(
                (isinstance(node, ast.Name) and node.id in stored)
                or (is_array and isinstance(node, ast.Subscript | ast.Call))
                for node in read
            ):
                values = [value if value.constant is not None else self.temporary(value) for value in values]
        else:
            whole = self.expression(source)
            if not isinstance(whole.type, BaseTuple):
                raise self.refuse(source, "is unpacked, and is no tuple")
            whole = self.temporary(whole)
            values = [self.part(whole, place) for place in range(len(whole.type))]
        if len(values) != len(targets):
            raise self.refuse(source, "has another number of items than its targets")
        for target, value in zip(targets, values, strict=True):
            self._assign(target, value)

    def _assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._assign_name(target, value)
        elif isinstance(target, ast.Subscript):
            place = self.visit(target)
            self.write(target, place)
            if place.length is not None:
                self._fill(target, place, value)
            elif value.length is not None:
                raise self.refuse(target, "is assigned an array")
            else:
                self.line(f"{place.text} = {value.text};")
        else:
            raise self.refuse(target, "cannot be assigned to in C")

    def _fill(self, target: ast.Subscript, place: Value, value: Value) -> None:
        """Assign a number, or the numbers of an array that is certainly another one, to a slice."""
        assert place.length is not None
        theirs, ours = value.bases or frozenset(self.parameters), place.bases or frozenset()
        can_overlap = ours & theirs or not (self.is_step or ours.isdisjoint(self.parameters))
        if place.columns or value.columns or (value.length is not None and can_overlap):
            raise self.refuse(target, "is a matrix, or an array that may overlap the assigned one")
        if value.length is None:
            text = (value if value.constant is not None else self.temporary(value)).text
        else:
            text = f"{value.within(ATOM)}[value_k]"
        self.line(f"for (int64_t value_k = 0; value_k < {place.length().text}; value_k++) {{")
        self.lines.append("    " * (self.depth + 1) + f"{place.within(ATOM)}[value_k] = {text};")
        self.line("}")

    def _assign_name(self, target: ast.Name, value: Value) -> None:
        name, kind = target.id, self.types[target.id]
        if name not in self.loaded:
            if self.effects:
                self.line(f"{value.text};")
            return
        label = self.unit.identifier(name, self, target)
        if value.columns:
            self.facts.columns[name] = value.columns
        if value.length is not None and not value.text:
            self._reserve(target, value)
            return
        if isinstance(kind, Integer) and not value.is_natural:
            self.facts.signed.add(name)
        if value.length is not None:
            if value.bases is None and name in self.facts.written:
                raise self.refuse(target, "writes to an array of a named tuple")
            self.facts.bases[name] = self.facts.bases.get(name, frozenset()) | (value.bases or frozenset())
            if self.stores.count(name) == 1 and (known := self._known_length(value)) is not None:
                self.facts.lengths[name] = known
        elif isinstance(kind, BaseTuple) and value.type != kind:
            raise self.refuse(target, f"has the type {value.type}, and {kind} elsewhere")
        parts = [
            (self.declaration(label, kind, is_constant=name not in self.facts.written), label, value.text)
        ]
        if name in self.facts.sized and value.length is not None:
            size = self.size_name(name, target)
            parts.append((f"int64_t {size}", size, value.length().text))
        end = f" /* to {value.end} */" if value.end else ""
        is_new, is_here = name not in self.declared, self._is_declared_here(name)
        once = "const " if self.stores.count(name) == 1 else ""
        for declaration, variable, text in parts:
            if is_new and not is_here:
                self.hoisted.append(f"    {declaration};")
            constant = "" if "*" in declaration else once
            self.line(f"{constant + declaration if is_new and is_here else variable} = {text};{end}")
            end = ""
        self.declared.add(name)

    def _known_length(self, array: Value) -> int | None:
        """Return the length of an array if it is known, without noting that it is needed."""
        assert array.length is not None
        sized = set(self.facts.sized)
        size: int | None = array.length().constant
        self.facts.sized = sized
        return size

    def _reserve(self, target: ast.Name, value: Value) -> None:
        """Declare an array with memory of its own."""
        name, is_kept = target.id, any(target.id in bases for bases in self.facts.bases.values())
        if self.stores.count(name) > 1 or (self.depth > 1 and is_kept):
            raise self.refuse(target, "is a new array each time, of which a part may be kept")
        assert value.length is not None
        count = value.length().constant * (value.columns or 1)
        label = self.unit.identifier(name, self, target)
        self.hoisted.append(f"    {self.unit.c_type(value.type.dtype, self, target)} {label}[{count}];")
        if name in self.facts.sized:
            self.hoisted.append(f"    const int64_t {self.size_name(name, target)} = {value.length().text};")
        self.declared.add(name)

    def _is_declared_here(self, name: str) -> bool:
        """Return True if the present statement stands in the innermost block with all uses of a variable."""
        places = [place for place, _ in self.places[name]]
        depth, first = len(places[0]), places[0][-1][0]
        is_read = any(
            isinstance(node.ctx, ast.Load) for place, node in self.places[name] if place == places[0]
        )
        is_within = all(len(place) >= depth and place[depth - 1][0] == first for place in places)
        return is_within and not is_read and not isinstance(self.statement, ast.For)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:  # noqa: N802
        place, value = self.visit(node.target), self.expression(node.value)
        if isinstance(node.target, ast.Subscript):
            if self.effects:
                value = self.temporary(value)
            self.write(node.target, place)
        result = self.arithmetic(node, place, node.op, value)
        if isinstance(node.target, ast.Name) and not result.is_natural:
            self.facts.signed.add(node.target.id)
        symbol = ARITHMETIC[type(node.op)][1]
        if symbol in ("+", "-", "*", "/") and result.type == place.type:
            self.line(f"{place.text} {symbol}= {value.text};")
        else:
            self.line(f"{place.text} = {result.text};")

    def visit_Return(self, node: ast.Return) -> None:  # noqa: N802
        if node.value is None or isinstance(self.returned, NoneType):
            self.line("return;")
            return
        if isinstance(node.value, ast.Tuple):
            items = [self.expression(item) for item in node.value.elts]
            value = self.tuple(node, self.returned, items)
        else:
            value = self.expression(node.value)
        if value.length is not None or (isinstance(self.returned, BaseTuple) and value.type != self.returned):
            raise self.refuse(node, f"returns {value.type}")
        self.line(f"return {value.text};")

    def visit_If(self, node: ast.If) -> None:  # noqa: N802
        opening, branch = "if", node
        while True:
            self.effects = []
            test = self.expression(branch.test)
            if opening == "if" and test.constant is not None:
                self.block(branch.body if test.constant else branch.orelse)
                return
            self._nested(f"{opening} ({test.text}) {{", branch.body)
            following = branch.orelse
            if len(following) != 1 or not isinstance(following[0], ast.If):
                break
            opening, branch = "} else if", following[0]
        if branch.orelse:
            self._nested("} else {", branch.orelse)
        self.line("}")

    def visit_Expr(self, node: ast.Expr) -> None:  # noqa: N802
        if isinstance(node.value, ast.Constant):
            return
        if not isinstance(node.value, ast.Call):
            raise self.refuse(node, "has no effect")
        self.line(f"{self.expression(node.value).text};")

    def visit_Pass(self, _: ast.Pass) -> None:  # noqa: N802
        self.line(";")

    def visit_Break(self, _: ast.Break) -> None:  # noqa: N802
        self.line("break;")

    def visit_Continue(self, _: ast.Continue) -> None:  # noqa: N802
        self.line("continue;")
