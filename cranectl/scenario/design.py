"""The settings in `[design]`, from which controllers of the flat family are designed."""

from collections import Counter
from typing import Annotated, Any, ClassVar

from pydantic import (
    Field,
    PlainSerializer,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapValidator,
    field_validator,
)
from pydantic_core import PydanticCustomError

from cranectl.scenario.settings import RATE, Scaled, Settings

# Frequencies scale by 1/√L, so gains of z⁗ = v scale by powers of it.
Weight = Annotated[float, Field(ge=1e-9, le=1e9)]
SLOWEST, FASTEST = 1e-3, 1e3  # [1/s], of poles


def _pole(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
    """Return a real pole unchanged; parse a complex one from text such as "-3+1j", since TOML has none."""
    if not isinstance(value, str):
        return check(value)
    try:
        pole = complex(value.replace("i", "j"))
    except ValueError:
        pole = complex("nan")
    if not (-FASTEST <= pole.real <= -SLOWEST and abs(pole.imag) <= FASTEST):
        raise PydanticCustomError(
            "pole",
            'Input should be a number from {lowest} to {highest}, or text like "-3+1j" of such parts',
            {"lowest": f"{-FASTEST:g}", "highest": f"{-SLOWEST:g}"},
        )
    return _text(pole) if pole.imag else pole.real


def _text(pole: complex) -> str:
    return str(pole).strip("()")


_REAL = {"type": "number", "minimum": -FASTEST, "maximum": -SLOWEST}
Pole = Annotated[
    float,  # or text
    Field(ge=-FASTEST, le=-SLOWEST),
    WrapValidator(_pole),
    PlainSerializer(lambda pole: pole),
    WithJsonSchema({"anyOf": [_REAL, {"type": "string", "pattern": "^-.*[ij]$"}]}),
]


class HinfSettings(Settings):
    """Settings of S/KS mixed sensitivity: W_s = (s/M + w) / (s + w A) on the error, a constant on v-bar."""

    peak: Annotated[float, Field(gt=1.0, le=1e3)] = Field(
        5.0, description="M, upper bound of |S| at high frequencies"
    )
    offset: Annotated[float, Field(ge=1e-6, le=1.0)] = Field(
        0.09, description="A, upper bound of |S| at frequency zero"
    )
    bandwidth: Annotated[float, Field(ge=1e-3, le=1e3), RATE] = Field(
        0.8, description="w, where |S| may reach 1 [rad/s]"
    )
    control_weight: Annotated[float, Field(ge=1e-9, le=1e3), Scaled(2.0)] = Field(
        1e-4, description="W_ks on v-bar [s⁴/m]; not in the thesis, this value reproduces its gammas"
    )
    back_off: Annotated[float, Field(ge=1.0, le=10.0)] = Field(
        1.005, description="gamma over the smallest gamma; at 1 the controller has a pole at -6e4 1/s"
    )
    gamma: Annotated[float, Field(gt=0.0, le=1e6)] | None = Field(
        None, description="design for this gamma instead of the smallest times back_off"
    )


class LoopShapingSettings(Settings):
    """Settings of Glover-McFarlane loop shaping, with the weight W_e = P + I/s on the error."""

    proportional: Annotated[float, Field(ge=1e-6, le=1e6), Scaled(-2.0)] = Field(
        17.88, description="P [1/s⁴]"
    )
    integral: Annotated[float, Field(ge=1e-6, le=1e6), Scaled(-2.5)] = Field(78.85, description="I [1/s⁵]")
    back_off: Annotated[float, Field(ge=1.0001, le=10.0)] = Field(
        1.01, description="gamma over the smallest gamma; above 1"
    )


class DesignSettings(Settings):
    """Settings of the feedback designs (thesis 5.2.1), the same for all axes."""

    SLOWEST_POLE: ClassVar[float] = SLOWEST  # [1/s]
    FASTEST_POLE: ClassVar[float] = FASTEST

    poles: Annotated[tuple[Pole, Pole, Pole, Pole], Field(strict=False), RATE] = Field(
        (-2.5, -2.5, -2.5, -2.5),
        description='closed-loop poles of pole-placement [1/s]; a conjugate pair as "-3+1j", "-3-1j"',
    )
    state_weights: Annotated[
        tuple[Weight, Weight, Weight, Weight],
        Field(strict=False),
        Scaled(-4.0),
        Scaled(-3.0),
        Scaled(-2.0),
        Scaled(-1.0),
    ] = Field((1000.0, 1.0, 1.0, 1.0), description="diagonal of Q of lqr, for e, ė, ë, e⃛")
    input_weight: Weight = Field(0.1, description="R of lqr, for v")
    hinf: HinfSettings = HinfSettings()
    loop_shaping: LoopShapingSettings = LoopShapingSettings()

    @field_validator("poles")
    @classmethod
    def _in_conjugate_pairs(cls, poles: tuple[float | str, ...]) -> tuple[float | str, ...]:
        complex_poles = Counter(pole for pole in map(complex, poles) if pole.imag)
        for pole, count in complex_poles.items():
            if complex_poles[pole.conjugate()] != count:
                raise PydanticCustomError(
                    "pairs",
                    "Input should be real poles and conjugate pairs",
                    {"remedy": f"add '{_text(pole.conjugate())}' in place of another pole"},
                )
        return poles
