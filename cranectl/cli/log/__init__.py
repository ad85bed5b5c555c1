"""`cranectl log`."""

from cranectl.cli.command import Group
from cranectl.cli.log.export import export_log
from cranectl.cli.log.layout import write_layout
from cranectl.cli.log.recover import recover_log_command

log_command = Group(
    "log",
    [export_log, write_layout, recover_log_command],
    help="Export a log, recover one, lay out its viewer.",
)
