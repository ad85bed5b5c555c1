"""Export a plant as the model of an FMU: the machine code of runs, with numbers of the rig as parameters."""

from cranectl.plants import DRIVES, PLANTS, AddressedPlant, Drive
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import TENSION, SignalGroup
from cranectl.simulate import Plan, SignalPath
from cranectl.status import RunStatus
from cranectl.support import Array, InputError
from cranectl.tools.export.description import Causality, FmuVariable
from cranectl.tools.export.fmu import Model, filled
from cranectl.tools.export.inference import check_compiler
from cranectl.tools.export.plant_numbers import PlantNumbers
from cranectl.tools.export.traced import Traced

EXPORTED_PLANTS = ("analytic", "elastic")  # whose code needs no engine
DRIVEN = ("bridge", "trolley", "rope")
WORDS_PER_LINE = 5


def plant_model(scenario: Scenario, plant: str, drive: str) -> Model:
    """Return a plant with a kind of drives as a model for `fmu_archive`; its sample is a control period.

    Raises InputError if the plant cannot be exported, or cannot show the scenario.
    """
    if plant not in EXPORTED_PLANTS:
        raise InputError(
            f"the {plant} plant as an FMU",
            allowed=f"{' or '.join(EXPORTED_PLANTS)}, which need no engine",
            remedy=f"take '--plants {EXPORTED_PLANTS[0]}'",
        )
    check_compiler()
    kind, plan = DRIVES.checked(drive), Plan.of(scenario)
    plan.begin(PLANTS.make(plant, scenario, kind))  # both raise InputError
    start = plan.initial_state
    numbers = PlantNumbers(scenario, plant, kind, start)
    parameters, constants = numbers.sorted_out()
    inputs, outputs = _inputs(scenario, kind, start), _outputs()
    first = len(inputs) + len(outputs)
    traced = {
        variable.name: Traced(variable.start, f"values[{first + k}]") for k, variable in enumerate(parameters)
    }
    memory, expressions = numbers.memory({}), numbers.expressions(traced)
    machine_code, actions = AddressedPlant.object_file(numbers.plant({}), "plant_step")
    title = f"{PLANTS.entry(plant).label} plant with {drive} drives, scenario {scenario.name}"
    words = [f"0x{word:x}," for word in memory.words]
    rows = [" ".join(words[k : k + WORDS_PER_LINE]) for k in range(0, len(words), WORDS_PER_LINE)]
    air = [f"values[{len(inputs) - 3 + k}]" for k in range(3)]  # the last inputs
    values = {
        "TITLE": title,
        "STATE": len(inputs),
        "LOAD": len(inputs) + len(SignalGroup.STATE),
        "TENSION": TENSION,
        **actions,
        "SLACK": float(RunStatus.SLACK_ROPE),
        "NON_FINITE": float(RunStatus.NON_FINITE),
        "AIR": ", ".join(air if scenario.effects.wind else ["0.0"] * 3),
        "WORDS": "".join(f"    {row}\n" for row in rows),
        "ADDRESSES": ", ".join(map(str, memory.addresses)),
        "EXPRESSIONS": "".join(
            f"    memory[{place}] = {number.text};\n" for place, number in sorted(expressions.items())
        ),
    }
    return Model(
        name=f"{plant}_{drive}",
        title=title,
        variables=(*inputs, *outputs, *parameters, *constants),
        period=scenario.period_ns / NANOSECONDS,
        memory=len(memory.words),
        sources={"plant.c": filled("fmi/plant.c.txt", values)},
        objects={"plant.o": machine_code},
    )


def _inputs(scenario: Scenario, drive: Drive, start: Array) -> list[FmuVariable]:
    """Return the inputs: commands, disturbances, forces on the load, and the velocity of the air."""
    first, wind = SignalPath.of(scenario, start, drive=drive).previous, scenario.effects.wind
    signals = SignalGroup.command(DRIVES[drive].command).signals
    commands = zip(DRIVEN, signals, first.tolist(), strict=False)
    return [
        *(FmuVariable.of_signal(f"command.{axis}", "input", *command) for axis, *command in commands),
        *_all("input", SignalGroup.DISTURBANCE),
        *_all("input", SignalGroup.LOAD_FORCE),
        *(
            FmuVariable(f"wind.{axis}", "input", "m/s", f"velocity of the air along {axis}", mean)
            for axis, mean in (zip("xyz", wind.mean, strict=True) if wind else ())
        ),
    ]


def _outputs() -> list[FmuVariable]:
    """Return the outputs, which hold at the end of a step under its command."""
    slack = int(RunStatus.SLACK_ROPE)
    text = f"0, or {slack} if the rope was slack at a sample of the step, its end included"
    status = FmuVariable("status", "output", "1", text, discrete=True)
    return [*_all("output", SignalGroup.STATE), *_all("output", SignalGroup.LOAD), status]


def _all(causality: Causality, group: SignalGroup) -> list[FmuVariable]:
    """Return a group of signals as variables, named as in logs."""
    prefix, signals = group.name, group.signals
    return [FmuVariable.of_signal(f"{prefix}.{signal.name}", causality, signal) for signal in signals]
