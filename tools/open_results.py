"""Run the program of the page "What the paper leaves open", and put what it prints into the page."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "concepts" / "open.md"
BLOCK = re.compile(r"(```sh\npython -m benchmarks\.findings (\d+)\n```\n```text\n)(.*?)(```)", re.DOTALL)


def printed(number: str) -> str:
    """Run one finding and return what it prints below its heading."""
    command = [sys.executable, "-m", "benchmarks.findings", number]
    lines = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout.splitlines()[1:]
    return "".join(f"{line.strip()}\n" for line in lines)


def main() -> None:
    """Rewrite the page's figures."""
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(BLOCK.sub(lambda block: block[1] + printed(block[2]) + block[4], text), encoding="utf-8")


if __name__ == "__main__":
    main()
