"""Campaigns: thousands of closed-loop runs of one scenario under stated uncertainty."""

from cranectl.campaign.definition import Campaign, UncertainParameter, sampled_scenario
from cranectl.campaign.load import load_campaign, make_campaign
from cranectl.campaign.sampling import sample_values
from cranectl.campaign.settings import campaign_file, campaign_names, read_campaign

__all__ = [
    "Campaign",
    "UncertainParameter",
    "campaign_file",
    "campaign_names",
    "load_campaign",
    "make_campaign",
    "read_campaign",
    "sample_values",
    "sampled_scenario",
]
