"""Files of an identified crane: its rig, and a campaign that varies it within its intervals."""

from collections import defaultdict

from cranectl.tools.measured.identification import AT_BOUND, NORMAL, Estimate, Identification
from cranectl.tools.measured.unknowns import ANGLE_DELAY, ANGLE_SCALE

LOWERED = "so low that the axis moves"  # friction that was not identified
MILLISECOND = 1e-3  # to which a rig's delay is rounded, since it must be a whole number of control periods
MAX_DEVIATIONS = 2.5  # half-widths from the value to the end of a distribution


def rig_text(result: Identification, base: str, logs: str) -> str:
    """Return the rig file of an identified crane: `base`, with what was fitted to `logs`."""
    values = {estimate.name: estimate for estimate in _of_rig(result)}
    tables: dict[str, list[str]] = defaultdict(list)
    lowered = [name for name in result.lowered if name not in values]
    for setting in (*values, *lowered):
        table, _, name = setting.rpartition(".")
        if name.isdigit():  # one of three axes: the others have the rig's own value
            table, _, name = table.rpartition(".")
            numbers = getattr(getattr(result.rig.effects, table.rpartition(".")[2]), name)
            settings = [f"{table}.{name}.{k}" for k in range(3)]
            known = ", ".join(
                _interval(values[s], "") if s in values else LOWERED if s in lowered else "as before"
                for s in settings
            )
            line = f"{name} = [{', '.join(f'{number:.8g}' for number in numbers)}]  # {known}"
        elif setting == "effects.delay.seconds":
            estimate = values[setting]
            rounded = round(estimate.value / MILLISECOND) * MILLISECOND
            line = f"{name} = {rounded:.3g}  # {estimate.value:.8g} {_interval(estimate)}, whole milliseconds"
        else:
            estimate = values[setting]
            line = f"{name} = {estimate.value:.8g}  # {_interval(estimate)}"
        if line not in tables[table]:
            tables[table].append(line)
    if result.replay != "motion":
        tables["effects.friction"].append("viscous = [0.0, 0.0, 0.0]  # part of time constants and gains")
    lines = [f"# Identified from {logs}, with 95 % intervals.", f'extends = "{base}"', *tables.pop("", [])]
    for table in sorted(tables):
        lines += ["", f"[{table}]", *tables[table]]
    return "\n".join(lines) + "\n"


def campaign_text(result: Identification, rig: str, name: str, logs: str) -> str:
    """Return a campaign that varies the crane in the file `rig` within its intervals."""
    drive = "ideal" if result.replay == "motion" else "velocity"
    lines = [
        f"# The crane identified from {logs}, with what its intervals leave open.",
        f'name = "{name}"',
        f'rig = "{rig}"',
        'scenario = "fast-diagonal"  # one that fits this crane',
        'controllers = ["lqr"]',
        'plants = ["mujoco"]',
        f'drive = "{drive}"',
        "runs = 200",
    ]
    for estimate in _of_rig(result):
        setting = estimate.name if estimate.name.startswith("effects.") else f"rig.{estimate.name}"
        lines += [
            "",
            f"[uncertain.{setting}]",
            'distribution = "normal"',
            f"mean = {estimate.value:.8g}",
            f"deviation = {estimate.half_width / NORMAL:.3g}",
        ]
        if estimate.name != "effects.installation.rope_offset":
            lines.append(f"low = {max(estimate.value - MAX_DEVIATIONS * estimate.half_width, 0.0):.6g}")
    return "\n".join(lines) + "\n"


def _of_rig(result: Identification) -> list[Estimate]:
    """Return the numbers that are settings of a rig, without those of the angles' sensor."""
    return [estimate for estimate in result.estimates if estimate.name not in (ANGLE_SCALE, ANGLE_DELAY)]


def _interval(estimate: Estimate, unit: str | None = None) -> str:
    if estimate.at_bound:
        return AT_BOUND
    return f"± {estimate.half_width:.2g} {estimate.unit if unit is None else unit}".rstrip()
