"""Would the tests notice a wrong sign? Mutate every term of the physics, one at a time, and see.

Each term of the functions in TARGETS, that is each operand of a sum and each expression that is assigned,
returned or listed, is flipped in sign, dropped, and made 1 % larger; in `limit_terms` each number with an
index is given the next one too. Every time a test in SUITE must fail.

    python validation/proofs/mutations.py                 all mutants, exit code 1 if one survives
    python validation/proofs/mutations.py flatness        only targets whose name contains this
    python validation/proofs/mutations.py --write         and write mutations.json, which `make docs` reads

Kernels run uncompiled, and every mutant in a forked copy of one process that has everything loaded.
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

from validation.proofs.limit_terms import INDEX, LIMITED, NUMBERS, is_indexed, is_number, listed_terms
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

# Equations of motion, flat map and linearising law, tracker, other laws, disturbance forces, drives, limits.
TARGETS = {
    "cranectl.model.dynamics": """
        angular_accelerations specific_rope_force rope_direction rope_direction_rate load_jacobian
        load_jacobian_rate mass_matrix coriolis_matrix gravity_vector kinetic_energy potential_energy
        load_position load_velocity rope_tension axis_masses drive_forces _tension forced_accelerations
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
    "cranectl.plants.mujoco.model": "ideal_inertia _ideal_drive_entries _velocity_drive_entries",
    "cranectl.plants.drake.model": """
        build_crane rotor_inertias axis_damping drive_forces _add_frame _add_load _add_body
    """,
    "cranectl.plants.drake.plant": """
        DrakePlant.observe_load DrakePlant.pull DrakePlant.hold DrakePlant.integrate DrakePlant.air_force
        DrakePlant._disturb DrakePlant._turn_joint DrakePlant._push_bodies
    """,
    "cranectl.scenario.rig": """
        RigParameters.driven_masses RigParameters.velocity_gains RigParameters.weight
        RigParameters.hanging_mass
    """,
    **LIMITED,
}

# Quick tests first; a mutant is dead as soon as one of them fails.
SUITE = [
    "tests/model/test_dynamics.py",
    "tests/model/test_flatness.py",
    "tests/controllers/test_flat.py",
    "tests/controllers/test_observer.py",
    "tests/controllers/test_law_design.py",
    "tests/simulate/test_actuation.py",
    "tests/scenario/test_rig.py",
    "tests/plants/test_disturbed_step.py",
    "tests/plants/test_plants.py",
    "tests/plants/test_force_drives.py",
    "tests/plants/elastic/test_accelerations.py",
    "tests/plants/elastic/test_step.py",
    "tests/plants/test_agreement.py",
    "tests/plants/test_sloping_rails.py",
]
# Instead, for what needs an extra.
OWN_SUITE = {
    "drake": ["tests/drake/test_model.py", "tests/drake/test_plant.py"],
    "planning": ["tests/planning/test_series.py", "tests/planning/test_limits.py"],
    "series": ["tests/planning/test_series.py", "tests/planning/test_limits.py"],
}
# Long without compiler, or endless when an equation is wrong.
LEFT_OUT = "derivation or level_1 or level_2 or invariant or energy or converge or order or feed_forward"

TIME_LIMIT = 600  # [s] for one mutant; a mutant that hangs is not caught
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
    """The test that failed, or None for a survivor."""

    mutant: Mutant
    killer: str | None


def terms(tree: ast.AST) -> Iterator[ast.expr]:
    """Return operands of sums, and whole right-hand sides, outside of indices."""
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


# What they are given is a term of the model that they build.
_BUILDERS = ("_add_body", "_slide", "_add_rotor", "PrismaticSpring")
# No terms: indices, status codes, views of arrays, objects.
_NOT_A_TERM = (
    "status",
    "RUNNING",
    "actuator",
    "spec.",
    "row[ERROR",
    "row[FLAT",
    "n_blocks",
    "ROBUSTIFIER",
    "np.eye",
    "drives",
    "held_forces",
    "work.along",
    "work.stuck[",
    "is_locked(",
    "locked and",
    "drive == ",
    "AXES[",
    "MultibodyPlant",
    "crane.world_body",
    "crane.AddJointActuator",
    "gravity_in_rig",
    "axis_damping",
    "_add_",
    "_slide",
    "(ideal_inertia",
    "self.load.EvalPoseInWorld",
    "ExternallyAppliedSpatialForce",
    "self.load.index",
    "SpatialForce",
    "np.nan",
    "np.zeros",
)
_NO_NUMBERS = ("crane", "base")
# Flipping these changes nothing: their sign enters squared, in m J'J and in m l² cos² beta.
_SQUARED = (
    "load_jacobian(q)",
    "rig.qpos[rig.distance[0]]",
    "cos(rig.qpos[rig.joints[4]])",
    "self.crane.GetPositions(self.context)[self.positions[2:]]",
)


def _is_term(node: ast.expr, tree: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, float) and node.value != 0.0
    return not any(
        isinstance(parent, ast.Subscript) and node in ast.walk(parent.slice) for parent in ast.walk(tree)
    )


def _is_scalar(node: ast.expr) -> bool:
    text = ast.unparse(node)
    return not text.startswith(_NOT_A_TERM) and text not in _NO_NUMBERS


def find_mutants(module: str, function: str) -> list[Mutant]:
    """Return all mutants of one function."""
    tree = _source(module, function)
    found = []
    for index, node in enumerate(_terms_in_order(tree, module)):
        text = ast.unparse(node)
        operations = (*OPERATIONS, INDEX) if module in LIMITED and is_indexed(node) else OPERATIONS
        found += [
            Mutant(module, function, index, text, node.lineno, operation)
            for operation in operations
            if operation != "flipped" or text not in _SQUARED
        ]
    return found


def _terms_in_order(tree: ast.AST, module: str) -> list[ast.expr]:
    """Return every term once, in the order of the source; its index names the mutant."""
    if module in LIMITED:
        found = [node for node in listed_terms(tree) if is_number(node)]
    else:
        found = [node for node in terms(tree) if _is_scalar(node)]
    nodes = {id(node): node for node in found if _is_term(node, tree)}.values()
    return sorted(
        nodes, key=lambda node: (node.lineno, node.col_offset, node.end_lineno, node.end_col_offset)
    )


def _source(module: str, name: str) -> ast.FunctionDef:
    """Parse a function or method, without importing what may not be installed."""
    found: Any = ast.parse(Path(importlib.util.find_spec(module).origin).read_text(encoding="utf-8"))
    for part in name.split("."):
        found = next(node for node in found.body if getattr(node, "name", "") == part)
    return found


def mutated_function(mutant: Mutant) -> Any:
    """Compile the function with its term changed, in its module's namespace."""
    tree = _source(mutant.module, mutant.function)
    target = _terms_in_order(tree, mutant.module)[mutant.term]
    replacement = _changed(copy.deepcopy(target), mutant)

    class Replace(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return replacement if node is target else self.generic_visit(node)

    definition = Replace().visit(tree)
    definition.decorator_list = []
    changed = ast.fix_missing_locations(ast.Module([definition], []))
    namespace = importlib.import_module(mutant.module).__dict__
    namespace.update(NUMBERS)
    local: dict[str, Any] = {}
    exec(compile(changed, f"<mutant of {mutant.module}>", "exec"), namespace, local)
    return local[definition.name]


def _changed(term: ast.expr, mutant: Mutant) -> ast.expr:
    if mutant.operation == INDEX:
        term.value = ast.Call(ast.Name("moved_on", ast.Load()), [term.value], [])
        return term
    if mutant.module in LIMITED:
        factor = ast.Constant({"flipped": -1.0, "dropped": 0.0, "x 1.01": 1.01}[mutant.operation])
        return ast.Call(ast.Name("scaled", ast.Load()), [term, factor], [])
    return {
        "flipped": ast.UnaryOp(ast.USub(), term),
        "dropped": ast.BinOp(ast.Constant(0.0), ast.Mult(), term),
        "x 1.01": ast.BinOp(ast.Constant(1.01), ast.Mult(), term),
    }[mutant.operation]


def install(mutant: Mutant) -> None:
    """Put the mutated function wherever the original is bound."""
    changed = mutated_function(mutant)
    if "." in mutant.function:
        name, method = mutant.function.split(".")
        owner = getattr(importlib.import_module(mutant.module), name)
        found = inspect.getattr_static(owner, method)
        computed = isinstance(found, property | functools.cached_property)
        setattr(owner, method, property(changed) if computed else changed)
        return
    original = getattr(importlib.import_module(mutant.module), mutant.function)
    for module in list(sys.modules.values()):
        for name, value in list(vars(module).items()) if hasattr(module, "__dict__") else []:
            if value is original:
                setattr(module, name, changed)


def keep_no_plans() -> None:
    """Use no plans that sound code made, and leave none of a mutant to it: their keys are of files."""
    plan: Any = importlib.import_module("cranectl.planning.plan")
    plan.kept = lambda _kind, _key, compute: compute()


class FirstFailure:
    """A pytest plugin that remembers the first test that failed."""

    killer: str | None = None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and self.killer is None:
            self.killer = report.nodeid


def run_suite(files: list[str], mutant: Mutant | None) -> str | None:
    """Run the tests on a mutant in a forked process, and return the test that failed, if any."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        first = FirstFailure()
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        signal.alarm(TIME_LIMIT)
        try:
            if mutant is not None:
                install(mutant)
                keep_no_plans()
            code = pytest.main(_pytest_arguments(files), plugins=[first])
            answer = first.killer or ("passed" if code == 0 else f"pytest exit code {int(code)}")
        except BaseException as error:
            answer = f"{type(error).__name__}: {error}"
        os.write(writer, answer.encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as stream:
        answer = stream.read()
    os.waitpid(child, 0)
    return answer.removeprefix("passed") or None


def _pytest_arguments(files: list[str]) -> list[str]:
    options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-k", f"not ({LEFT_OUT})"]
    # Who reads why a test failed? To tell it, every file of the package is compiled anew: it has a plugin.
    options += ["--assert=plain", "-p", "no:hypothesispytest"]
    return [*options, "--rootdir", str(ROOT), *(str(ROOT / file) for file in files)]


def suite_of(mutant: Mutant) -> list[str]:
    """Return the suite, tests of the mutant's own module first."""
    rooms = mutant.module.split(".")[1:]
    for room in OWN_SUITE.keys() & rooms:
        return OWN_SUITE[room]
    return sorted(SUITE, key=lambda file: -sum(f"/{room}/" in file for room in rooms))


def _warm_up(mutants: list[Mutant]) -> None:
    """Load in the parent what every forked copy needs."""
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


def judge(mutant: Mutant) -> Verdict:
    """Run the tests against one mutant."""
    return Verdict(mutant, run_suite(suite_of(mutant), mutant))


def results_of(verdicts: list[Verdict]) -> Results:
    """Return the results by function, a row a term, with the short names of the tests that failed."""
    found: dict[str, dict[tuple[int, str, int], dict[str, str]]] = {}
    for verdict in verdicts:
        m = verdict.mutant
        rows = found.setdefault(f"{m.module}.{m.function}", {})
        killers = rows.setdefault((m.line, " ".join(m.text.split()), m.term), {})
        killers[m.operation] = _short(verdict.killer) if verdict.killer else SURVIVED
    return {
        function: [
            Row(line, text, tuple(killers.get(kind) for kind in (KINDS if INDEX in killers else OPERATIONS)))
            for (line, text, _), killers in rows.items()
        ]
        for function, rows in found.items()
    }


def merged(found: Results, before: Results) -> Results:
    """Return `found` in place of the same functions' results of `before`, of all targets in their order."""
    targets = [f"{module}.{function}" for module, names in TARGETS.items() for function in names.split()]
    both = {**before, **found}
    return {target: both[target] for target in targets if target in both}


def _short(killer: str) -> str:
    """Return file and test without folder and parameters."""
    return killer.split("/")[-1].split("[")[0].removesuffix(".py")


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", nargs="?", default="", help="only targets whose name contains this")
    parser.add_argument(
        "--write",
        action="store_true",
        help=f"write {DATA.name}; with NAME only its part of it",
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
    _warm_up(mutants)
    for suite in {tuple(sorted(suite_of(mutant))) for mutant in mutants}:
        if broken := run_suite(list(suite), None):
            print(f"the tests fail without any mutant: {broken}")
            return 1
    verdicts = []
    with ProcessPoolExecutor(arguments.jobs, mp_context=multiprocessing.get_context("fork")) as pool:
        for verdict in pool.map(judge, mutants):
            verdicts.append(verdict)
            if verdict.killer is None:
                m = verdict.mutant
                print(f"SURVIVED {m.module}.{m.function}:{m.line} {m.operation}: {m.text}", flush=True)
            if len(verdicts) % 50 == 0:
                print(f"{len(verdicts)} of {len(mutants)} mutants", flush=True)
    survivors = sum(verdict.killer is None for verdict in verdicts)
    print(f"{len(verdicts)} mutants, {len(verdicts) - survivors} caught, {survivors} survived")
    if arguments.write:
        before = read_results(DATA) if arguments.name else {}
        write_results(merged(results_of(verdicts), before), DATA)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
