"""Names: a class or a number has a name of its own, so that a reader of two modules cannot confuse them."""

import ast
from collections import defaultdict
from collections.abc import Iterator

import cranectl
from tests.conftest import ROOT

PACKAGE = ROOT / "cranectl"
CLASSES_OF_ONE_NAME: dict[str, str] = {}  # and why nobody confuses them
NUMBERS_OF_ONE_NAME = {
    "EXTENSION": "a place in a state; each model has a state of its own",
    "ROBUSTIFIER": "a place in a state, as EXTENSION",
    "STATES": "how many states a model has; the model is the module's subject",
    "IDEAL_INERTIA": "the same of two engines, each as large as its arithmetic allows",
    "GHOST": "opacity of the same ghost in a viewer and in pictures",
    "LONGEST_ARROW": "length of the same arrow in a viewer and in pictures",
    "ROPE_WIDTH": "of the same rope, in pixels and in metres",
    "TRAIL_POINTS": "of the same trail in a viewer and in pictures",
}


def modules() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        yield str(path.relative_to(PACKAGE)), ast.parse(path.read_text())


def classes() -> dict[str, list[str]]:
    found = defaultdict(list)
    for place, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(place)
    return found


def number(node: ast.AST) -> float | None:
    """The value of an expression of numbers."""
    try:
        value = eval(compile(ast.Expression(node), "", "eval"), {"__builtins__": {}})  # type: ignore[arg-type]
    except Exception:
        return None
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def numbers() -> dict[str, dict[str, float]]:
    """Numbers at the top of modules: {name: {module: value}}."""
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for place, tree in modules():
        for node in tree.body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            for target in targets if isinstance(node, ast.Assign | ast.AnnAssign) else ():
                names, values = [target], [node.value]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    names, values = target.elts, node.value.elts
                for name, expression in zip(names, values, strict=False):
                    if isinstance(name, ast.Name) and (value := number(expression)) is not None:
                        found[name.id][place] = value
    return found


def test_classes_have_names_of_their_own() -> None:
    doubles = {name: places for name, places in classes().items() if len(places) > 1}
    assert doubles.keys() == CLASSES_OF_ONE_NAME.keys(), doubles
    public = {name for name in cranectl.__all__ if isinstance(getattr(cranectl, name), type)}
    assert len(public) > 10
    assert not public & doubles.keys()


def test_a_number_has_one_value_wherever_it_has_the_same_name() -> None:
    doubles = {name: places for name, places in numbers().items() if len(set(places.values())) > 1}
    assert doubles.keys() == NUMBERS_OF_ONE_NAME.keys(), doubles


def test_numbers_are_found_in_all_their_forms() -> None:
    found = numbers()
    assert found["BLOCK_TIMEOUT"] == {"simulate/child.py": 120.0}
    assert found["MAX_DEADLINE"] == {"loaders/process_law.py": 5.0}
    assert len(found) > 300


# Words of a private dialect, and what the field says instead.
DIALECT = {
    "": {
        "told": "declared, reported",
        "asked": "requested",
        "each": "the item's name",
        "wish": "velocity command",
        "door": "loader",
        "LawDesign": "ControllerDesign",
        "AddressedLaw": "CompiledController",
        "entered": "bind_address",
        "at_start": "with_own_memory",
        "by_address": "called_by_address",
    },
    "plants/elastic": {
        "rubs": "has_friction",
        "swings": "has_body",
        "stretches": "has_elastic_rope",
        "gives": "has_frame",
        "settle": "stick_or_slip",
        "change_sides": "update_modes",
        "instant": "find_event",
        "look_at_end": "evaluate_end",
        "hold": "reaction_forces",
        "bend": "curvature",
        "given": "locked_acceleration",
        "held": "holding_force",
    },
    "planning": {
        "bend": "hessian",
        "price": "penalty",
        "quantities": "constraints",
        "way": "route",
        "legs": "passages",
        "Broken": "violation",
        "let": "slack",
        "given": "stated",
        "held": "retained",
    },
    "loaders": {"told": "declared", "given": "input", "held": "buffer"},
    "campaign": {"piece": "trial", "price": "penalty"},
    "live": {"told": "reported", "given": "input"},
}


def identifiers(tree: ast.Module) -> Iterator[str]:
    """Yield the names of variables, arguments, functions and classes that a module defines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name


def dialect(place: str, tree: ast.Module) -> set[str]:
    words = [room for room in DIALECT if place.startswith(room)]
    return {name for name in identifiers(tree) if any(name in DIALECT[room] for room in words)}


def test_names_are_words_of_the_field() -> None:
    assert {place: found for place, tree in modules() if (found := dialect(place, tree))} == {}


def test_a_word_of_the_dialect_is_noticed() -> None:
    code = ast.parse("def told(given): rubs = [each for each in given]")
    assert dialect("report/page.py", code) == {"told", "each"}
    assert dialect("plants/elastic/step.py", code) == {"told", "given", "rubs", "each"}
