"""A campaign as it is run: settings, the nominal scenario and the uncertain parameters."""

from dataclasses import dataclass

from cranectl.campaign.correlation import Copula
from cranectl.campaign.parameters import Parameter
from cranectl.campaign.settings import CampaignSettings
from cranectl.scenario import Scenario


@dataclass(frozen=True)
class Campaign:
    """Everything that decides the samples; the same in every process that has loaded it."""

    settings: CampaignSettings
    nominal: Scenario  # what the controller assumes
    parameters: tuple[Parameter, ...]  # columns of all samples
    copula: Copula | None
    runs: int  # number of samples

    @property
    def names(self) -> tuple[str, ...]:
        """Dotted names of the parameters, the columns of all samples."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def varied(self) -> tuple[int, ...]:
        """Columns of the parameters that have more than one value."""
        return tuple(k for k, p in enumerate(self.parameters) if p.distribution.varies)
