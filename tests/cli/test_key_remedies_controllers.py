"""Remedies for the declarations in a controller's file work on the refused input."""

import sys

from tests.remedies import Case, remedy_test, written
from tests.tools.export.loaders.test_process_controller import PROGRAM

RUN = "run s.toml --plants analytic --controller"
STEP = "\n    def step(parameters, measured, reference, memory, command):\n        return 0\n"
PREPARE = "\n    def prepare(nominal):\n        return "
CLASSES = {
    "Law": "memory = 2",
    "Texts": "parameters = {'gain': 'high'}",
    "Numbers": "parameters = {'gain': 2.0}",
    "NoMemory": "memory = 'abc'",
    "Never": "every = 0",
    "Odd": "command = 'speed'",
    "Velocity": "command = 'velocity'",
    "Five": "parameters = 5",
    "Twice": "logged = {'the error': 0}",
    "Renamed": "logged = {'the_error': 0}",
    "Beyond": "memory = 2; logged = {'error': 5}",
    "Within": "memory = 2; logged = {'error': 1}",
    "Larger": "memory = 6; logged = {'error': 5}",
    "NotPrepared": "prepare = 5",
    "Selfish": "\n    def prepare(self, nominal):\n        return [], []",
    "Alone": f"{PREPARE}[]",
    "Complex": f"{PREPARE}[1j], []",
    "Pair": f"{PREPARE}[], []",
    "Same": "name = 'law'",
    "Timeless": "period = -0.01",
    "Timed": "period = 0.01",
}
SOURCE = "".join(f"class {name}:\n    {body}{STEP}\n" for name, body in CLASSES.items())
SOURCE += "def two(parameters, measured):\n    return 0\n\n"
SOURCE += "def law(parameters, measured, reference, memory, command):\n    return 0\n"
for name, line in {
    "slow": "vars()",
    "modulo": "command[0] = measured[0] % 1.5",
    "ending": "return 5",
}.items():
    SOURCE += f"def {name}(parameters, measured, reference, memory, command):\n    {line}\n    return 0\n"
PROCESS_SETTINGS = f"logged = ['bridge_error']\nprogram = ['{sys.executable}', 'program.py']\n"
FILES = {
    "s.toml": "name='s'\nduration=0.1\nreference.start=[1.0, 0.77, -0.7]\n",
    "law.py": SOURCE,
    "broken.py": "def law(:\n",
    "program.py": PROGRAM.replace("BROKEN", "pass"),
    "peer.toml": f"name = 'peer'\n{PROCESS_SETTINGS}",
    "none.toml": "name = 'peer'\n",
    "absent.toml": "name = 'peer'\nlogged = ['bridge_error']\nprogram = ['no-such-program', 'program.py']\n",
    "timed.toml": f"name = 'peer'\n{PROCESS_SETTINGS}period = 0.01\n",
    "data.toml": f"name = 'peer'\n{PROCESS_SETTINGS}files = ['data/*.csv']\n",
    "own.toml": f"name = 'peer'\n{PROCESS_SETTINGS}files = ['*.py']\n",
    "unreachable.toml": "name = 'peer'\naddress = 'tcp://127.0.0.1:9'\n",
}
INTEGRAL, OFFSET_FREE = "controller.lqr-integral", "controller.lqr-offset-free"
SAMPLED = "control.period=0.05"
VALIDATE = "cranectl validate s.toml --plants analytic --controller"
EXPORT = "cranectl design --scenario s.toml --export"
WITHOUT = "cranectl design lqr --export"
CASES = {
    "cli/design.py": [
        Case("choose another place with --export", f"{EXPORT} . lqr", f"{EXPORT} c lqr"),
        Case("export each by itself", f"{EXPORT} c lqr pid", f"{EXPORT} c lqr"),
        Case("add --scenario fast-diagonal, or another one", f"{WITHOUT} c",
             f"{WITHOUT} c --scenario fast-diagonal"),
    ],
    "tools/export/prepared.py": [
        Case("write the step with numbers, loops and functions of math", f"{EXPORT} c law.py:slow",
             f"{EXPORT} c law.py:law"),
        Case("export the Python controller that it was made from, or compile its own source",
             f"{EXPORT} c peer.toml", f"{EXPORT} c law.py:law"),
        Case("correct the controller, or take another scenario", f"{EXPORT} c law.py:ending",
             f"{EXPORT} c law.py:law"),
    ],
    "tools/export/expressions.py": [
        Case("write line {} of {} in another way", f"{EXPORT} c law.py:modulo", f"{EXPORT} c law.py:law"),
    ],
    "loaders/python_controller.py": [
        Case("name it: {}:NAME", "law.py", "law.py:law"),
        Case("did you mean '{}'?", "law.py:Numbrs", "law.py:Numbers"),
        Case("define step({}), see 'cranectl new controller NAME'", "law.py:lqr", "law.py:law"),
        Case("give it these five; a method of a class is a @staticmethod", "law.py:two", "law.py:law"),
        Case("correct it", "broken.py:law", "law.py:law"),
        Case("give the number that it has by default", "law.py:Texts", "law.py:Numbers"),
        Case("give one of the two", "law.py:NoMemory", "law.py:Law"),
    ],
    "controllers/controller.py": [
        Case("choose one of those listed above", "law.py:Odd", "law.py:Velocity --drive velocity"),
        Case("write it in one of these ways", "law.py:Five", "law.py:Numbers"),
        Case("take another name", "law.py:Twice", "law.py:Renamed"),
        Case("give the time between two steps for which the controller was made, or leave it out",
             "law.py:Timeless", "law.py:Law"),
        Case("write prepare(nominal)", "law.py:NotPrepared", "law.py:Pair"),
        Case("give {}.{} such a value: {}", ["lqr-integral", f"{INTEGRAL}.input_weight=-1.0"],
             ["lqr-integral", f"{INTEGRAL}.input_weight=1.0"]),
    ],
    "support/errors.py": [
        Case("give {}", "law.py:Never", "law.py:Law"),
    ],
    "controllers/preparation.py": [
        Case("log another place, or give it a larger memory", "law.py:Beyond", "law.py:Within",
             "law.py:Larger"),
        Case("correct it; in a class it has no self", "law.py:Selfish", "law.py:Pair"),
        Case("return both, an empty one too", "law.py:Alone", "law.py:Pair"),
        Case("return real numbers, at most {} in each", "law.py:Complex", "law.py:Pair"),
        Case("add --set control.period={} to the command, or set it in the scenario", "law.py:Timed",
             ["law.py:Timed", "control.period=0.01"]),
        Case("add --set control.period={} to the command, or set it in the scenario", "timed.toml",
             ["timed.toml", "control.period=0.01"]),
    ],
    "loaders/opening.py": [
        Case("correct the path", "lost.py:law", "law.py:law"),
        Case("name it: {}", "peer.toml:law", "peer.toml"),
        Case("give one of them another name in its file, or take one at a time",
             f"{VALIDATE} law.py:law,law.py:Same", "law.py:Same"),
    ],
    "tools/export/loaders/process_controller.py": [
        Case("give one of the two", "none.toml", "peer.toml"),
        Case("correct 'program'", "absent.toml", "peer.toml"),
        Case("correct 'files'", "data.toml", "own.toml"),
        Case("correct it", "unreachable.toml", "peer.toml"),
    ],
    "controllers/lqr_integral.py": [
        Case("raise input_weight in [controller.lqr-integral]",
             ["lqr-integral", SAMPLED, f"{INTEGRAL}.input_weight=1e-6"],
             ["lqr-integral", SAMPLED, f"{INTEGRAL}.input_weight=10.0"]),
    ],
    "controllers/lqr_offset_free.py": [
        Case("lower error_weight and rate_weight in [controller.lqr-offset-free]",
             ["lqr-offset-free", SAMPLED, f"{OFFSET_FREE}.error_weight=1e6"],
             ["lqr-offset-free", SAMPLED, f"{OFFSET_FREE}.error_weight=1.0"]),
    ],
}  # fmt: skip


files = written(FILES)
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, RUN)
