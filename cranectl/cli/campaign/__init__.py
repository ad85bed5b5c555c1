"""`cranectl campaign`."""

import click

from cranectl.cli.campaign.list import list_campaigns, show_campaign
from cranectl.cli.campaign.replay import replay_campaign
from cranectl.cli.campaign.report import report_campaign
from cranectl.cli.campaign.run import run_campaign

HELP = """Run one scenario many times under stated uncertainty.

A campaign is a TOML file: a scenario, controllers, plants, and a distribution for each uncertain parameter.
Its result is a directory of Parquet files, the same for any number of workers.

\b
  cranectl campaign list                     campaigns that come with cranectl
  cranectl campaign show lab-rig             what is uncertain in it, and how long it takes
  cranectl campaign run lab-rig              run it; Ctrl-C, then --resume goes on with it
  cranectl campaign report logs/campaign-lab-rig
  cranectl campaign replay logs/campaign-lab-rig --worst 3
"""

campaign_command = click.Group("campaign", help=HELP)
for command in (list_campaigns, show_campaign, run_campaign, report_campaign, replay_campaign):
    campaign_command.add_command(command)
