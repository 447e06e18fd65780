"""Copy the table of results from a demo's summary.json into README.md, between its two markers.

Its rows are the highlights that the experiments declare.
"""

import argparse
import json
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"


def table(summary: dict[str, Any]) -> str:
    """Return the Markdown table: middle [p5, p95] of each controller."""
    lines: list[str] = []
    for experiment in summary["experiments"].values():
        for highlight in experiment["highlights"]:
            name = highlight["metric"]
            metric, rows = experiment["metrics"][name], experiment["spread"][highlight["scenario"]]
            if not lines:
                lines.append(f"| median [p5, p95] over seeds | unit | {' | '.join(rows)} |")
                lines.append("|---|---|" + "---|" * len(rows))
            cells = [_cell(row[name], metric) for row in rows.values()]
            lines.append(f"| {highlight['label']} | {metric['unit']} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(spread: dict[str, float], metric: dict[str, Any]) -> str:
    if not spread["n"]:
        return "–"
    low, middle, high = (metric["scale"] * spread[key] for key in ("p5", metric["middle"], "p95"))
    return f"{middle:.3g} [{round(low, 4):.3g}, {high:.3g}]"


def main() -> None:
    """Rewrite README.md from the summary named on the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("summary", type=Path, help="summary.json of `make demo`")
    summary = json.loads(parser.parse_args().summary.read_text(encoding="utf-8"))
    readme = Path(__file__).parents[1] / "README.md"
    text = readme.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    readme.write_text(f"{before}{BEGIN}\n{table(summary)}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
