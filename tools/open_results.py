"""Run the program of the page "What the paper leaves open", and put what it prints into the page."""

import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "concepts" / "open.md"
BLOCK = re.compile(r"(```sh\npython docs/findings\.py (\d+)\n```\n```text\n)(.*?)(```)", re.DOTALL)


def printed(number: str) -> str:
    """Run one finding and give what it prints below its heading."""
    command = [sys.executable, str(DOCS / "findings.py"), number]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[1:]
    return "".join(f"{line.strip()}\n" for line in lines)


def main() -> None:
    """Rewrite the page's figures."""
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(BLOCK.sub(lambda block: block[1] + printed(block[2]) + block[4], text), encoding="utf-8")


if __name__ == "__main__":
    main()
