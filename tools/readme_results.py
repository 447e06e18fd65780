"""Copy the table of results from a demo's summary.json into README.md, between its two markers."""

import json
import sys
from pathlib import Path

ROWS = (
    ("task-safety", "wiping", "ink_removed", "ink removed, held-out boards", "%", 100.0),
    ("task-safety", "wiping", "tool_force_median_n", "tool force in contact", "N", 1.0),
    ("task-safety", "wiping", "tool_force_peak_n", "tool force, peak", "N", 1.0),
    ("joint-safety", "bottle", "contact_steady_n", "bottle: steady contact force", "N", 1.0),
    ("joint-safety", "bottle", "contact_peak_n", "bottle: peak contact force", "N", 1.0),
    ("joint-safety", "bottle", "tau_steady_nm", "bottle: steady external torque", "N m", 1.0),
    ("joint-safety", "thrust meter", "contact_steady_n", "thrust meter: steady contact force", "N", 1.0),
    ("joint-safety", "thrust meter", "contact_peak_n", "thrust meter: peak contact force", "N", 1.0),
    ("joint-safety", "thrust meter", "tau_steady_nm", "thrust meter: steady external torque", "N m", 1.0),
    *(
        ("disturbance", push := f"push on link {link} while {mode}", "error_max_mm", push, "mm", 1.0)
        for mode in ("holding", "wiping")
        for link in (4, 5, 6)
    ),
)
BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"


def table(summary: dict) -> str:
    """Write the Markdown table: median [p5, p95] of each controller."""
    lines = ["| median [p5, p95] over seeds | unit | vices | paper | safe |", "|---|---|---|---|---|"]
    for experiment, scenario, metric, label, unit, scale in ROWS:
        by_controller = summary["experiments"][experiment]["spread"][scenario]
        cells = []
        for controller in ("vices", "paper", "safe"):
            spread = by_controller[controller][metric]
            low, middle, high = (scale * spread[key] for key in ("p5", "median", "p95"))
            cells.append(f"{middle:.3g} [{round(low, 4):.3g}, {high:.3g}]")
        lines.append(f"| {label} | {unit} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Rewrite README.md from the summary named on the command line."""
    summary = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    readme = Path(__file__).parents[1] / "README.md"
    text = readme.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    readme.write_text(f"{before}{BEGIN}\n{table(summary)}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
