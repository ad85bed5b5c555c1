"""Change every term of the physics, one at a time, and check that a test fails.

A term is an operand of a sum, or an expression that is assigned, returned or an element of a list. Each term
of the functions in TARGETS is flipped in sign, dropped, and made 1 % larger. Each element with an index in
`limit_terms` also gets the next index. For each of these mutants a test in SUITE must fail.

    python validation/proofs/mutations.py                 all mutants, exit code 1 if one survives
    python validation/proofs/mutations.py flatness        only targets whose name contains this
    python validation/proofs/mutations.py --write         also write mutations.json, which `make docs` reads

Functions run uncompiled. Each mutant runs in a forked copy of one process, which has loaded all modules. The
test that mutations.json names for a mutant runs first, and the others of its suite only if that one passes.
"""

import os

os.environ["NUMBA_DISABLE_JIT"] = "1"

import argparse
import ast
import copy
import functools
import importlib
import importlib.util
import inspect
import multiprocessing
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from validation.proofs.limit_terms import HELPERS, INDEX, LIMIT_TARGETS, is_indexed, is_number, listed_terms
from validation.proofs.mutation_results import (
    DATA,
    KINDS,
    SURVIVED,
    Results,
    Row,
    read_results,
    write_results,
)

ROOT = Path(__file__).resolve().parents[2]

# By module: equations of motion, flat map, controllers, drives, plants, rig, limits of planned motions.
TARGETS = {
    "cranectl.model.dynamics": """
        angular_accelerations specific_rope_force rope_direction rope_direction_rate load_jacobian
        load_jacobian_rate mass_matrix coriolis_matrix gravity_vector kinetic_energy potential_energy
        load_position load_velocity rope_tension axis_masses drive_forces axis_force _tension
        forced_accelerations
        winch_force
    """,
    "cranectl.model.flatness": """
        slopes_from_angles angles_from_slopes flat_output drive_accelerations slope_acceleration
        linearising_input state_and_input
    """,
    "cranectl.controllers.flat": "robustify linearising_step control_step",
    "cranectl.controllers.observer": "make_observer correct",
    "cranectl.controllers.lqr_integral": "feedback matrices",
    "cranectl.controllers.pid": "impulses",
    "cranectl.controllers.flat_velocity": "set_points lead_times linear_gain",
    "cranectl.simulate.actuation": "actuate drive_acceleration take_set_points brake",
    "cranectl.plants.analytic": """
        drive_accelerations derivative observe_load outer_force passive_accelerations pivot_torque
    """,
    "cranectl.plants.elastic.motion": """
        dot cross sum_of rope_directions rate_of_turn derivative n_squared
        move_axes locked_acceleration rail_force load_pull add_axes solve reaction_forces
    """,
    "cranectl.plants.mujoco.disturbed_step": "apply_disturbance apply_drag turn_rate",
    "cranectl.plants.mujoco.effects": "body_entries",
    "cranectl.plants.mujoco.sites": "state_of_sites rope_acceleration pull_along_rope read_load_of_sites",
    "cranectl.plants.mujoco.model": """
        ideal_inertia _ideal_drive_entries _velocity_drive_entries _rotor_entries
    """,
    "cranectl.plants.drake.model": """
        build_crane rotor_inertias axis_damping drive_forces _add_frame _add_load _add_body
    """,
    "cranectl.plants.drake.plant": """
        DrakePlant.observe_load DrakePlant.pull DrakePlant.hold DrakePlant.integrate DrakePlant.air_force
        DrakePlant._disturb DrakePlant._turn_joint DrakePlant._push_bodies
    """,
    "cranectl.scenario.rig": """
        RigParameters.axis_masses RigParameters.driven_masses RigParameters.velocity_gains
        RigParameters.weight RigParameters.hanging_mass
    """,
    **LIMIT_TARGETS,
}

# Fast tests come first, because the first failure ends the tests of a mutant.
SUITE = [
    "tests/model/test_dynamics.py",
    "tests/model/test_flatness.py",
    "tests/controllers/test_flat.py",
    "tests/controllers/test_observer.py",
    "tests/controllers/test_controller_design.py",
    "tests/simulate/test_actuation.py",
    "tests/scenario/test_rig.py",
    "tests/plants/test_disturbed_step.py",
    "tests/plants/test_force_drives.py",
    "tests/plants/test_plants.py",
    "tests/plants/elastic/test_accelerations.py",
    "tests/plants/elastic/test_step.py",
    "tests/plants/test_agreement.py",
]
# Tests of modules whose path contains these names, in place of SUITE.
OWN_SUITES = {
    "drake": ["tests/drake/test_model.py", "tests/drake/test_plant.py"],
    "planning": ["tests/planning/test_series.py", "tests/planning/test_limits.py"],
    "series": ["tests/planning/test_series.py", "tests/planning/test_limits.py"],
    "sites": ["tests/plants/test_sites.py"],
}
# Tests that take long in uncompiled code, or never end with a wrong equation.
EXCLUDED_TESTS = (
    "derivation or level_1 or level_2 or invariant or energy or converge or order or feed_forward"
)

TIME_LIMIT = 600  # [s] of a mutant; one that reaches it is not caught
OPERATIONS = ("flipped", "dropped", "x 1.01")


@dataclass(frozen=True)
class Mutant:
    """One term of one function, changed in one way."""

    module: str
    function: str
    term: int
    text: str  # the term as written
    line: int
    operation: str


@dataclass(frozen=True)
class Verdict:
    """Result of the tests of one mutant."""

    mutant: Mutant
    failed_test: str | None  # the first one, or None if the mutant survives


def terms(tree: ast.AST) -> Iterator[ast.expr]:
    """Yield operands of sums, assigned and returned expressions, and arguments of model builders."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            yield node.left
            yield node.right
        elif isinstance(node, ast.Assign | ast.AugAssign | ast.Return) and node.value is not None:
            yield from _elements(node.value)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in _BUILDERS:
            yield from (a for a in node.args if isinstance(a, ast.Attribute | ast.Subscript | ast.BinOp))


def _elements(value: ast.expr) -> Iterator[ast.expr]:
    """Yield the scalar expressions in a value: elements of tuples, lists, np.array and zip."""
    if isinstance(value, ast.Tuple | ast.List):
        for element in value.elts:
            yield from _elements(element)
    elif isinstance(value, ast.Call) and value.args and isinstance(value.args[0], ast.List):
        yield from _elements(value.args[0])
    elif not isinstance(value, ast.Constant) or isinstance(value.value, float):
        yield value


# The arguments of these calls are terms.
_BUILDERS = ("_add_body", "_slide", "_add_rotor", "PrismaticSpring")
# Expressions that begin so are no terms: indices, status codes, views of arrays, objects.
_NO_TERM_PREFIXES = (
    "status", "RUNNING", "actuator", "spec.", "row[ERROR", "row[FLAT", "n_blocks", "ROBUSTIFIER", "np.eye",
    "drives", "held_forces", "work.along", "work.stuck[", "is_locked(", "locked and", "drive == ", "AXES[",
    "MultibodyPlant", "crane.world_body", "crane.AddJointActuator", "gravity_in_rig", "axis_damping", "_add_",
    "_slide", "(ideal_inertia", "self.load.EvalPoseInWorld", "ExternallyAppliedSpatialForce",
    "self.load.index", "SpatialForce", "np.nan", "np.zeros",
)  # fmt: skip
_NO_TERMS = ("crane", "base")
# Flipping the sign of these has no effect, because they are squared: in m J'J and in m l² cos² beta.
_SQUARED = (
    "load_jacobian(q)",
    "rig.qpos[rig.distance[0]]",
    "cos(rig.qpos[rig.joints[4]])",
    "self.crane.GetPositions(self.context)[self.positions[2:]]",
    "sensors[seen[3 + i]] - sensors[seen[10 + i]]",
    "way * velocity",
)


def _is_term(node: ast.expr, tree: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, float) and node.value != 0.0
    return not any(
        isinstance(parent, ast.Subscript) and node in ast.walk(parent.slice) for parent in ast.walk(tree)
    )


def _is_scalar(node: ast.expr) -> bool:
    text = ast.unparse(node)
    return not text.startswith(_NO_TERM_PREFIXES) and text not in _NO_TERMS


def find_mutants(module: str, function: str) -> list[Mutant]:
    """Return all mutants of one function."""
    tree = _source(module, function)
    mutants = []
    for index, node in enumerate(_terms_in_order(tree, module)):
        text = ast.unparse(node)
        operations = (*OPERATIONS, INDEX) if module in LIMIT_TARGETS and is_indexed(node) else OPERATIONS
        mutants += [
            Mutant(module, function, index, text, node.lineno, operation)
            for operation in operations
            if operation != "flipped" or text not in _SQUARED
        ]
    return mutants


def _terms_in_order(tree: ast.AST, module: str) -> list[ast.expr]:
    """Return every term once, in the order of the source; the index of a term identifies its mutants."""
    if module in LIMIT_TARGETS:
        candidates = [node for node in listed_terms(tree) if is_number(node)]
    else:
        candidates = [node for node in terms(tree) if _is_scalar(node)]
    nodes = {id(node): node for node in candidates if _is_term(node, tree)}.values()
    return sorted(
        nodes, key=lambda node: (node.lineno, node.col_offset, node.end_lineno, node.end_col_offset)
    )


def _source(module: str, name: str) -> ast.FunctionDef:
    """Parse a function or method without importing its module, which may need an extra."""
    node: Any = ast.parse(Path(importlib.util.find_spec(module).origin).read_text(encoding="utf-8"))
    for part in name.split("."):
        node = next(child for child in node.body if getattr(child, "name", "") == part)
    return node


def compile_mutant(mutant: Mutant) -> Any:
    """Return the function with its changed term, in the namespace of its module."""
    tree = _source(mutant.module, mutant.function)
    target = _terms_in_order(tree, mutant.module)[mutant.term]
    replacement = _change(copy.deepcopy(target), mutant)

    class Replace(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return replacement if node is target else self.generic_visit(node)

    definition = Replace().visit(tree)
    definition.decorator_list = []
    changed = ast.fix_missing_locations(ast.Module([definition], []))
    namespace = importlib.import_module(mutant.module).__dict__
    namespace.update(HELPERS)
    local: dict[str, Any] = {}
    exec(compile(changed, f"<mutant of {mutant.module}>", "exec"), namespace, local)
    return local[definition.name]


def _change(term: ast.expr, mutant: Mutant) -> ast.expr:
    if mutant.operation == INDEX:
        term.value = ast.Call(ast.Name("shift", ast.Load()), [term.value], [])
        return term
    if mutant.module in LIMIT_TARGETS:
        factor = ast.Constant({"flipped": -1.0, "dropped": 0.0, "x 1.01": 1.01}[mutant.operation])
        return ast.Call(ast.Name("scale", ast.Load()), [term, factor], [])
    return {
        "flipped": ast.UnaryOp(ast.USub(), term),
        "dropped": ast.BinOp(ast.Constant(0.0), ast.Mult(), term),
        "x 1.01": ast.BinOp(ast.Constant(1.01), ast.Mult(), term),
    }[mutant.operation]


def install(mutant: Mutant) -> None:
    """Replace the original function by the mutant in all loaded modules."""
    changed = compile_mutant(mutant)
    if "." in mutant.function:
        name, method = mutant.function.split(".")
        owner = getattr(importlib.import_module(mutant.module), name)
        original = inspect.getattr_static(owner, method)
        is_property = isinstance(original, property | functools.cached_property)
        setattr(owner, method, property(changed) if is_property else changed)
        return
    original = getattr(importlib.import_module(mutant.module), mutant.function)
    for module in list(sys.modules.values()):
        for name, value in list(vars(module).items()) if hasattr(module, "__dict__") else []:
            if value is original:
                setattr(module, name, changed)


def disable_stored_plans() -> None:
    """Neither read nor store plans: their keys contain files, which are the same for all mutants."""
    plan: Any = importlib.import_module("cranectl.planning.plan")
    plan.kept = lambda _kind, _key, compute: compute()


class FirstFailure:
    """A pytest plugin that stores the first test that failed."""

    test: str | None = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and self.test is None:
            self.test = report.nodeid


def run_suite(files: list[str], mutant: Mutant | None, name: str = "") -> str | None:
    """Run the tests on a mutant in a forked process, and return the test that failed, if any.

    `name` restricts them to the tests whose names contain it.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        failure = FirstFailure()
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        signal.alarm(TIME_LIMIT)
        try:
            if mutant is not None:
                install(mutant)
                disable_stored_plans()
            code = pytest.main(_pytest_arguments(files, name), plugins=[failure])
            outcome = failure.test or ("passed" if code == 0 else f"pytest exit code {int(code)}")
        except BaseException as error:
            outcome = f"{type(error).__name__}: {error}"
        os.write(writer, outcome.encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as stream:
        outcome = stream.read()
    os.waitpid(child, 0)
    return outcome.removeprefix("passed") or None


def _pytest_arguments(files: list[str], name: str) -> list[str]:
    selected = f"{name} and not ({EXCLUDED_TESTS})" if name else f"not ({EXCLUDED_TESTS})"
    options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-k", selected]
    # Without explanations of failures, pytest need not rewrite and compile every file of the package.
    options += ["--assert=plain", "-p", "no:hypothesispytest"]
    return [*options, "--rootdir", str(ROOT), *(str(ROOT / file) for file in files)]


def suite_of(mutant: Mutant) -> list[str]:
    """Return the files of tests of a mutant, those of its own module first."""
    rooms = mutant.module.split(".")[1:]
    for room in OWN_SUITES.keys() & rooms:
        return OWN_SUITES[room]
    return sorted(SUITE, key=lambda file: -sum(f"/{room}/" in file for room in rooms))


def _load_modules(mutants: list[Mutant]) -> None:
    """Load the modules that every forked copy needs."""
    os.chdir(ROOT)
    for module in (
        *{mutant.module: None for mutant in mutants},
        "cranectl.simulate",
        "cranectl.compare.runs",
        "mujoco",
        "numpy",
        "scipy.linalg",
        "control",
        "cranectl.planning.plan",
    ):
        importlib.import_module(module)


def check_mutant(mutant: Mutant) -> Verdict:
    """Run the tests on one mutant: first the one that mutations.json names, then all."""
    suite = suite_of(mutant)
    recorded = _recorded_tests().get((*_row_of(mutant), mutant.operation), "")
    file, _, name = recorded.partition("::")
    if files := [path for path in suite if name and path.endswith(f"/{file}")]:
        failed = run_suite(files, mutant, name)
        if failed and _short_name(failed).endswith(f"::{name}"):
            return Verdict(mutant, failed)
    return Verdict(mutant, run_suite(suite, mutant))


@functools.cache
def _recorded_tests() -> dict[tuple[str, int, str, str], str]:
    """Return the tests of mutations.json by function, number of the term, its text, and operation."""
    return {
        (function, term, row.term, kind): test
        for function, rows in (read_results(DATA) if DATA.exists() else {}).items()
        for term, row in enumerate(rows)
        for kind, test in zip(KINDS, row.tests, strict=False)
        if test
    }


def _row_of(mutant: Mutant) -> tuple[str, int, str]:
    """Return function, number and text of the term of a mutant."""
    return f"{mutant.module}.{mutant.function}", mutant.term, " ".join(mutant.text.split())


def results_of(verdicts: list[Verdict]) -> Results:
    """Return the results by function, with a row for each term and the short names of the failed tests."""
    functions: dict[str, dict[tuple[int, int, str], dict[str, str]]] = {}
    for verdict in verdicts:
        function, term, text = _row_of(verdict.mutant)
        rows = functions.setdefault(function, {})
        failed = rows.setdefault((verdict.mutant.line, term, text), {})
        failed[verdict.mutant.operation] = (
            _short_name(verdict.failed_test) if verdict.failed_test else SURVIVED
        )
    return {
        function: [
            Row(line, text, tuple(failed.get(kind) for kind in (KINDS if INDEX in failed else OPERATIONS)))
            for (line, _, text), failed in rows.items()
        ]
        for function, rows in functions.items()
    }


def merge(new: Results, previous: Results) -> Results:
    """Replace the results of functions in `previous` by those in `new`; the order is that of TARGETS."""
    targets = [f"{module}.{function}" for module, names in TARGETS.items() for function in names.split()]
    results = {**previous, **new}
    return {target: results[target] for target in targets if target in results}


def _short_name(test: str) -> str:
    """Return file and name of a test, without folder and parameters."""
    return test.split("[")[0].split("/")[-1].removesuffix(".py")


def main() -> int:
    """Test the mutants that the command line selects; return 1 if one survives."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", nargs="?", default="", help="only targets whose name contains this")
    parser.add_argument(
        "--write", action="store_true", help=f"write {DATA.name}; with NAME only the part of these targets"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N")
    arguments = parser.parse_args()
    mutants = [
        mutant
        for module, functions in TARGETS.items()
        for function in functions.split()
        if arguments.name in f"{module}.{function}"
        for mutant in find_mutants(module, function)
    ]
    _load_modules(mutants)
    for suite in {tuple(sorted(suite_of(mutant))) for mutant in mutants}:
        if failed := run_suite(list(suite), None):
            print(f"{failed} fails without any mutant; make this test pass first")
            return 1
    verdicts = []
    with ProcessPoolExecutor(arguments.jobs, mp_context=multiprocessing.get_context("fork")) as pool:
        for verdict in pool.map(check_mutant, mutants):
            verdicts.append(verdict)
            if verdict.failed_test is None:
                m = verdict.mutant
                print(f"SURVIVED {m.module}.{m.function}:{m.line} {m.operation}: {m.text}", flush=True)
            if len(verdicts) % 50 == 0:
                print(f"{len(verdicts)} of {len(mutants)} mutants", flush=True)
    survivors = sum(verdict.failed_test is None for verdict in verdicts)
    print(f"{len(verdicts)} mutants, {len(verdicts) - survivors} caught, {survivors} survived")
    if arguments.write:
        previous = read_results(DATA) if arguments.name else {}
        write_results(merge(results_of(verdicts), previous), DATA)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
