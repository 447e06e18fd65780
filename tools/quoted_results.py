"""Run the commands that the documentation quotes with what they print, and put what they print now into the pages.

    python tools/quoted_results.py                            all pages; hours
    python tools/quoted_results.py docs/concepts/open.md      one page
    python tools/quoted_results.py --only disturbance         commands that contain this

A quoted result is a block `sh` of one line with a block `text` right behind it, which may quote a part: the lines that
are printed in the same words, in their order. A page is written after each command, so a run that is stopped has lost
nothing.
"""

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"```sh\n([^`\n]+)\n```\n```text\n(.*?)```", re.DOTALL)
PROGRAMS = {"python": [sys.executable], "contactsafe": [sys.executable, "-m", "contactsafe"]}


def printed(command: str) -> list[str]:
    """Run a command in the repository's folder and return the lines that it prints."""
    program, *words = shlex.split(command)
    done = subprocess.run([*PROGRAMS[program], *words], check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    return [line.rstrip() for line in done.stdout.splitlines()]


def label(line: str) -> str:
    """Return a line without its figures and without its spaces, which move with them."""
    return re.sub(r"[-+\d.]+|\s+", "", line)


def excerpt(printed: list[str], quoted: list[str]) -> list[str]:
    """Return the lines printed that stand for the lines quoted; all of them where the first one is not found.

    A line whose words have changed, as 'ok' to 'MISSED', is the one behind the line before it.
    """
    labels = [label(line) for line in printed]
    if not quoted or label(quoted[0]) not in labels:
        return printed
    lines, at = [], 0
    for line in quoted:
        wanted = label(line)
        at = labels.index(wanted, at) if wanted in labels[at:] else at
        lines += printed[at : at + 1]
        at += 1
    return lines


def renew(page: Path, only: str) -> None:
    """Run a page's commands that contain a text, one after the other."""
    for command, quoted in BLOCK.findall(page.read_text(encoding="utf-8")):
        if only not in command:
            continue
        print(f"{page.relative_to(ROOT)}: {command}", flush=True)
        now = "".join(f"{line}\n" for line in excerpt(printed(command), quoted.splitlines()))
        head = f"```sh\n{command}\n```\n```text\n"
        before, _, after = page.read_text(encoding="utf-8").partition(head)
        page.write_text(before + head + now + after[after.index("```") :], encoding="utf-8")


def main() -> None:
    """Rewrite the pages."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, default=sorted((ROOT / "docs").rglob("*.md")))
    parser.add_argument("--only", default="", help="run commands that contain this")
    options = parser.parse_args()
    for page in options.pages:
        renew(page.resolve(), options.only)


if __name__ == "__main__":
    main()
