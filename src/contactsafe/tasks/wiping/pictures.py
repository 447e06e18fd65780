"""How the wiping task is shown: its metrics, its curve, and the stage of its films."""

from contactsafe.results.figures import Panel
from contactsafe.results.metrics import Aim, Highlight, Metric
from contactsafe.results.recording import Stage, level_rectangle
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.tasks.wiping.board import BoardConfig
from contactsafe.tasks.wiping.whiteboard import INK, OBJECT

NAME = "wiping"
POLICY = "A learned policy wipes ink off a whiteboard with a simulated Franka Panda."

METRICS = (
    Metric(
        "ink_removed",
        "ink removed, mean",
        "%",
        100.0,
        main=True,
        aim=Aim(at_least=80.0, ratio_at_least=0.95),
        mean=True,
    ),
    Metric("clean", "boards wiped clean, mean", "%", 100.0, main=True, mean=True),
    Metric("time_s", "time to a clean board", "s"),
)
HIGHLIGHTS = (Highlight(NAME, "ink_removed", "Ink wiped off boards never seen before"),)

PANELS = (Panel("ink left", "%", lambda run: 100.0 * run.curves["ink_left"]),)


def stage(arm: Arm, board: BoardConfig) -> Stage:
    """Return the arm over its board."""
    colours = {INK: (24, 48, 104), OBJECT: (20, 20, 22)}
    return Stage(*description_and_tool(arm), level_rectangle(board.centre, board.size), colours)
