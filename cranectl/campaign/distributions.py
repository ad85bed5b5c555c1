"""The registry of distributions."""

from typing import Annotated

from pydantic import Field

from cranectl.campaign.continuous import LogUniform, Normal, Uniform
from cranectl.campaign.discrete import Choice, Fixed, Integers
from cranectl.campaign.distribution import Distribution

DISTRIBUTIONS: dict[str, type[Distribution]] = {
    "uniform": Uniform,
    "normal": Normal,
    "log-uniform": LogUniform,
    "choice": Choice,
    "integers": Integers,
    "fixed": Fixed,
}
AnyDistribution = Annotated[
    Uniform | Normal | LogUniform | Choice | Integers | Fixed, Field(discriminator="distribution")
]
