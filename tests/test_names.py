"""Names of classes and constants are unambiguous, and all names are words of the field."""

import ast
import functools
import re
from collections import defaultdict
from collections.abc import Iterator

import cranectl
from tests.syntax import PACKAGE, trees_in

CLASSES_OF_ONE_NAME: dict[str, str] = {}  # name: why readers do not confuse them
NUMBERS_OF_ONE_NAME = {
    "STATES": "the number of states of the model that is the subject of the module",
    "IDEAL_INERTIA": "the same inertia in two engines, each as large as its arithmetic allows",
    "GHOST": "opacity of the same ghost in a viewer and in pictures",
    "MAX_ARROW": "length of the same arrow in a viewer and in pictures",
    "ROPE_WIDTH": "of the same rope, in pixels and in metres",
    "TRAIL_POINTS": "of the same trail in a viewer and in pictures",
}


def modules() -> Iterator[tuple[str, ast.Module]]:
    for path, tree in trees_in().items():
        yield str(path.relative_to(PACKAGE)), tree


def classes() -> dict[str, list[str]]:
    result = defaultdict(list)
    for path, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                result[node.name].append(path)
    return result


def number(node: ast.AST) -> float | None:
    """Return the value of a constant numeric expression."""
    try:
        value = eval(compile(ast.Expression(node), "", "eval"), {"__builtins__": {}})  # type: ignore[arg-type]
    except Exception:
        return None
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


@functools.cache
def numbers() -> dict[str, dict[str, float]]:
    """Return the numeric constants of all modules: {name: {module: value}}."""
    constants: dict[str, dict[str, float]] = defaultdict(dict)
    for path, tree in modules():
        for node in tree.body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            for target in targets if isinstance(node, ast.Assign | ast.AnnAssign) else ():
                names, values = [target], [node.value]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    names, values = target.elts, node.value.elts
                for name, expression in zip(names, values, strict=False):
                    if isinstance(name, ast.Name) and (value := number(expression)) is not None:
                        constants[name.id][path] = value
    return constants


def test_class_names_are_unique() -> None:
    doubles = {name: places for name, places in classes().items() if len(places) > 1}
    assert doubles.keys() == CLASSES_OF_ONE_NAME.keys(), doubles
    public = {name for name in cranectl.__all__ if isinstance(getattr(cranectl, name), type)}
    assert len(public) > 10
    assert not public & doubles.keys()


def test_constants_of_one_name_have_one_value() -> None:
    doubles = {name: places for name, places in numbers().items() if len(set(places.values())) > 1}
    assert doubles.keys() == NUMBERS_OF_ONE_NAME.keys(), doubles


SUPERLATIVE = re.compile(r"_?(MOST|LEAST|LARGEST|SMALLEST|LONGEST|SHORTEST|FEWEST|HIGHEST|LOWEST)(_|$)")


def test_limits_begin_with_max_or_min() -> None:
    assert all(map(SUPERLATIVE.match, ("MOST_FRAMES", "_SHORTEST")))
    assert not [name for name in numbers() if SUPERLATIVE.match(name)]


def test_constants_of_all_forms_are_found() -> None:
    constants = numbers()
    assert constants["BLOCK_TIMEOUT"] == {"simulate/child.py": 120.0}
    assert constants["MAX_DEADLINE"] == {"tools/export/loaders/process_controller.py": 5.0}
    assert len(constants) > 300


# Words that readers from the field do not expect, by the rooms where they count.
DIALECT = {
    "": "told asked each patience law wish wanted GIVEN door LawDesign AddressedLaw entered at_start "
    "by_address",
    "plants/elastic": "rubs swings stretches gives settle change_sides instant look_at_end hold bend given "
    "held",
    "planning": "bend price quantities way legs Broken let given held acting moved stretch",
    "reference": "way given held",
    "render": "sign push",
    "thesis": "ours place",
    "loaders": "told given held",
    "tools/export/loaders": "told given held",
    "campaign": "piece price",
    "live": "told given",
}
TIME_LAWS = {"law"}  # what is meant there, and what the field calls them


def identifiers(tree: ast.Module) -> Iterator[str]:
    """Yield the names of variables, arguments, functions and classes that a module defines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name


def dialect(path: str, tree: ast.Module) -> set[str]:
    words = {word for room in DIALECT if path.startswith(room) for word in DIALECT[room].split()}
    return words & {*identifiers(tree)} - (TIME_LAWS if path == "reference/time_laws.py" else set())


def test_no_name_is_a_word_of_the_dialect() -> None:
    assert {path: words for path, tree in modules() if (words := dialect(path, tree))} == {}


def test_a_word_of_the_dialect_is_detected() -> None:
    code = ast.parse("def told(given): rubs = [each for each in given]")
    assert dialect("report/page.py", code) == {"told", "each"}
    assert dialect("plants/elastic/step.py", code) == {"told", "given", "rubs", "each"}
