"""A C unit: some steps with all functions, types and helpers that they need."""

import inspect
import re
from collections.abc import Callable
from typing import Any

from numba.core.types import Array, BaseTuple, Boolean, Integer, UniTuple, float64, int64

from cranectl.tools.export.calls import MATH
from cranectl.tools.export.expressions import Expressions
from cranectl.tools.export.functions import Function, FunctionTranslator
from cranectl.tools.export.inference import STEP_TYPES, Type, infer_types
from cranectl.tools.export.values import Value

RESERVED = {
    *re.findall(
        r"\w+",
        "auto break case char const continue default do double else enum extern float for goto if inline int "
        "long register restrict return short signed sizeof static struct switch typedef union unsigned void "
        "volatile while bool true false main pow y0 y1 yn j0 j1 jn gamma",
    ),
    *MATH.values(),
}
# What Python's operators and slices do, where C's do something else.
HELPERS = {
    "index": ("int64_t index, int64_t size", "return index < 0 ? index + size : index;"),
    "bound": (
        "int64_t index, int64_t size",
        "const int64_t place = index < 0 ? index + size : index;",
        "return place < 0 ? 0 : place < size ? place : size;",
    ),
    "span": (
        "int64_t lower, int64_t upper, int64_t size",
        "const int64_t end = upper < size ? upper : size;",
        "return lower < end ? end - lower : 0;",
    ),
    "floor_divide": (
        "int64_t a, int64_t b",
        "if (b == 0 || (b == -1 && a == INT64_MIN))",
        "    return 0;",
        "return a / b - (a % b != 0 && (a % b < 0) != (b < 0));",
    ),
    "modulo": (
        "int64_t a, int64_t b",
        "if (b == 0 || b == -1)",
        "    return 0;",
        "return a % b + (a % b != 0 && (a % b < 0) != (b < 0) ? b : 0);",
    ),
    "abs_int": ("int64_t a", "return a < 0 ? -a : a;"),
    "min_int": ("int64_t a, int64_t b", "return b < a ? b : a;"),
    "max_int": ("int64_t a, int64_t b", "return b > a ? b : a;"),
    "min_double": ("double a, double b", "return b < a ? b : a;"),
    "max_double": ("double a, double b", "return b > a ? b : a;"),
}


class Unit:
    """Translate functions and collect what the C file needs, in the order in which C must define it."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._helpers: dict[str, str] = {}
        self._structs: dict[Type, tuple[str, str]] = {}
        self._functions: dict[Any, Function | None] = {}
        self._names: set[str] = set(RESERVED)

    def step(self, step: Callable[..., int], name: str) -> None:
        """Translate a function with the arguments of a controller's step; raise InputError if that fails."""
        self._names.add(name)
        inferred = infer_types(step, STEP_TYPES)
        translator = FunctionTranslator(self, step, inferred, set())
        function, text = translator.translate(name, is_entry=True)
        if inputs := function.written & set(function.parameters[:3]):
            raise translator.refuse(translator.tree, f"writes to {min(inputs)}, which is an input")
        self.texts.append(text)
        self._functions[step, *((kind, False) for kind in STEP_TYPES)] = function

    def text(self) -> str:
        """Return the C text of all functions, after the types and helpers that they need."""
        structs = [text for _, text in self._structs.values()]
        return "\n\n".join([*structs, *self._helpers.values(), *self.texts]) + "\n"

    def function(
        self, function: Callable[..., Any], arguments: list[tuple[Type, bool]], caller: Expressions, node: Any
    ) -> Function:
        """Return a translated function for types of its arguments, and whether these are natural numbers."""
        key = (function, *arguments)
        if key not in self._functions:
            self._functions[key] = None
            types = tuple(kind for kind, _ in arguments)
            names = list(inspect.signature(function).parameters)
            if len(names) != len(types):
                raise caller.refuse(node, "leaves out arguments")
            signed = {name for name, (_, is_natural) in zip(names, arguments, strict=True) if not is_natural}
            translator = FunctionTranslator(self, function, infer_types(function, types), signed)
            name = function.__name__.strip("_")  # C reserves names that begin with "_"
            name = self._free_name(name if name == function.__name__ else f"{name}_")
            self._functions[key], text = translator.translate(name)
            self.texts.append(text)
        translated = self._functions[key]
        if translated is None:
            raise caller.refuse(node, "calls itself")
        return translated

    def _free_name(self, name: str) -> str:
        """Return `name`, with a number if it is taken."""
        free, number = name, 1
        while free in self._names:
            number += 1
            free = f"{name}_{number}"
        self._names.add(free)
        return free

    def identifier(self, name: str, function: Expressions, node: Any) -> str:
        """Return the name of a variable in C; raise InputError if it cannot have one."""
        if not name.isascii() or name.startswith(("cranectl_", "value_")):
            raise function.refuse(node, f"has the name {name}, which C does not allow or which is taken")
        return f"{name}_" if name in RESERVED else name

    def helper(self, name: str, *arguments: str) -> str:
        """Return the call of a helper, which the file then defines."""
        if name not in self._helpers:
            parameters, *body = HELPERS[name] if name in HELPERS else _power(int(name.removeprefix("power_")))
            kind = parameters.partition(" ")[0]  # all parameters have the type of the value
            lines = [
                f"static {kind} cranectl_{name}({parameters})",
                "{",
                *(f"    {line}" for line in body),
                "}",
            ]
            self._helpers[name] = "\n".join(lines)
        return f"cranectl_{name}({', '.join(arguments)})"

    def value(self, name: str, *arguments: Value) -> Value:
        """Return the value of a helper for integers; of bounds that are known, a number."""
        known = [argument.constant for argument in arguments]
        if name == "span" and None not in known:
            size = max(min(known[1], known[2]) - known[0], 0)
            return Value(str(size), int64, constant=size, is_natural=True)
        is_natural = name in ("bound", "span", "abs_int")
        return Value(
            self.helper(name, *(argument.text for argument in arguments)), int64, is_natural=is_natural
        )

    def c_type(self, kind: Type, function: Expressions, node: Any) -> str:
        """Return the C type of a number or a tuple; raise InputError for any other type."""
        if isinstance(kind, Boolean):
            return "bool"
        if isinstance(kind, Integer) and kind == int64:
            return "int64_t"
        if kind == float64:
            return "double"
        if isinstance(kind, BaseTuple):
            return self._struct(kind, function, node)
        raise function.refuse(node, f"has the type {kind}")

    def is_uniform(self, kind: Type) -> bool:
        """Return True for a tuple that is an array in C: without names, of one type of numbers."""
        return (
            isinstance(kind, UniTuple) and not hasattr(kind, "fields") and not isinstance(kind.dtype, Array)
        )

    def member(self, kind: Type, place: int) -> str:
        """Return the member of a tuple's structure at a place."""
        if self.is_uniform(kind):
            return f"item[{place}]"
        return str(kind.fields[place]) if hasattr(kind, "fields") else f"item_{place}"

    def _struct(self, kind: Type, function: Expressions, node: Any) -> str:
        """Return the name of the structure of a tuple, which the file then defines."""
        if kind not in self._structs:
            members, owner = [], getattr(kind, "instance_class", None)
            name = owner.__name__ if owner else f"tuple_{len(kind)}"
            if self.is_uniform(kind):
                item = self.c_type(kind.dtype, function, node)
                members, name = [f"{item} item[{len(kind)}];"], f"{item}_{len(kind)}"
            else:
                for place, part in enumerate(kind):
                    members += self._members(part, self.member(kind, place), function, node)
            name = self._free_name(name)
            lines = ["typedef struct {", *(f"    {member}" for member in members), f"}} {name};"]
            self._structs[kind] = (name, "\n".join(lines))
        return self._structs[kind][0]

    def _members(self, part: Type, label: str, function: Expressions, node: Any) -> list[str]:
        """Return the members of a structure for a part of a tuple; an array has a pointer and a length."""
        if isinstance(part, Array):
            return [f"const {self.c_type(part.dtype, function, node)} *{label};", f"int64_t {label}_size;"]
        return [f"{self.c_type(part, function, node)} {label};"]


def _power(exponent: int) -> tuple[str, ...]:
    """Return the helper for a power, by the products that Numba computes."""
    lines, factors, power = ["double a"], [], 1
    while power <= exponent:
        if exponent & power:
            factors.append(f"a{power}" if power > 1 else "a")
        power *= 2
    for doubled in (2**k for k in range(1, exponent.bit_length())):
        half = f"a{doubled // 2}" if doubled > 2 else "a"
        lines.append(f"const double a{doubled} = {half} * {half};")
    return (*lines, f"return {' * '.join(factors)};")
