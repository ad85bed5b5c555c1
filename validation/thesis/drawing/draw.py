"""Draw the figures of the thesis's page as SVG files that cranectl ships.

    python validation/thesis/drawing/draw.py              into validation/thesis/diagrams/
    python validation/thesis/drawing/draw.py DIRECTORY

Titles and notes are in validation/thesis/diagrams.toml. The files are equal on every platform, and a test
compares them.
"""

import argparse
from pathlib import Path

import crane
import robust
import simulation
import tracking
from blocks import new_drawing, to_svg

from cranectl.tools.thesis.page import DIAGRAM_DIRECTORY, DIAGRAMS

DRAWINGS = {
    "2.1": crane.draw_crane,
    "3.1": tracking.draw_tracking_loop,
    "4.2": tracking.draw_closed_loop,
    "4.3": tracking.draw_extended_loop,
    "4.4": robust.draw_standard_problem,
    "4.5": robust.draw_mixed_sensitivity,
    "4.6": robust.draw_specifications,
    "4.7": robust.draw_shaped_plant,
    "4.8": robust.draw_shaped_loop,
    "4.9": robust.draw_final_controller,
    "5.1": simulation.draw_simulation,
    "5.2": simulation.draw_plant,
    "5.3": simulation.draw_flat_coordinates,
    "5.4": simulation.draw_linearising_law,
    "5.5": simulation.draw_state_feedback,
    "5.6": simulation.draw_robustified,
}


def main() -> None:
    """Draw all figures into the directory of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("directory", nargs="?", type=Path, default=DIAGRAM_DIRECTORY)
    directory = parser.parse_args().directory
    for number, draw in DRAWINGS.items():
        drawing = new_drawing()
        draw(drawing)
        svg = to_svg(drawing, DIAGRAMS[number]["title"])
        (directory / f"{number}.svg").write_text(f"{svg}\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
