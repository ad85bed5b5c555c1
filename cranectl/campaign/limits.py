"""What a user asks of every run; a run that breaks a limit counts as failed."""

from typing import Annotated, Any

from pydantic import Field

from cranectl.settings import Settings

Limit = Annotated[float, Field(ge=0.0)] | None


class Limits(Settings):
    """Limits on metrics, by name; by default none. A metric that a run lacks breaks its limit."""

    max_error_m: Limit = Field(None, description="largest tracking error [m]")
    rms_error_m: Limit = Field(None, description="RMS of the tracking error [m]")
    final_error_m: Limit = Field(None, description="tracking error at the end [m]")
    settling_time_s: Limit = Field(None, description="from rest of the reference to rest of the load [s]")
    overshoot_m: Limit = Field(None, description="way past the end point [m]")
    max_rest_error_m: Limit = Field(None, description="largest error once the reference rests [m]")
    residual_sway_rad: Limit = Field(None, description="largest sway once the reference rests [rad]")
    max_sway_rad: Limit = Field(None, description="largest angle between rope and plumb line [rad]")
    rms_sway_rad: Limit = Field(None, description="RMS of that angle [rad]")
    saturated_s: Limit = Field(None, description="time during which drives are at their limits [s]")
    min_rope_tension_n: Limit = Field(None, description="lower limit of the rope's tension [N]")

    @property
    def given(self) -> dict[str, float]:
        """The limits that are set, by metric."""
        return {name: value for name, value in self if value is not None}


def within(metric: str, values: Any, limit: float) -> Any:
    """Whether `values` of `metric`, one or an array, keep `limit`; NaN, a value that is absent, does not."""
    return values >= limit if low_is_bad(metric) else values <= limit


def low_is_bad(metric: str) -> bool:
    """Whether small values of `metric` are the bad ones."""
    return metric.startswith("min_rope_tension")
