"""`cranectl campaign`."""

from cranectl.campaign.commands.list import list_campaigns, show_campaign
from cranectl.campaign.commands.results import replay_campaign, report_campaign
from cranectl.campaign.commands.run import run_campaign
from cranectl.cli.command import CommandGroup

HELP = """Run one scenario many times under stated uncertainty.

A campaign is a TOML file: a scenario, controllers, plants, and a distribution for each uncertain parameter.
Its result is a directory of Parquet files, the same for any number of workers.
"""

campaign_command = CommandGroup(
    "campaign", [list_campaigns, show_campaign, run_campaign, report_campaign, replay_campaign], help=HELP
)
