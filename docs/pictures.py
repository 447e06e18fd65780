"""Pictures of the gallery, one an example, drawn into docs/gallery when the documentation is built.

An example is run again where its picture is missing or its source has changed; `make gallery` runs them all.
"""

import hashlib
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parent
FOLDER = DOCS / "gallery"
SOURCES = DOCS.parent / "examples"
EXAMPLES = sorted(SOURCES.glob("[0-9]*.py"))
_DIGESTS = FOLDER / "digests.json"


def digest(example: Path) -> str:
    """Return the digest of what an example's picture is drawn by: its file, and what all examples use."""
    shared = sorted(path for path in SOURCES.iterdir() if path.is_file() and path not in EXAMPLES)
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in (example, *shared))).hexdigest()


def stale(all_of_them: bool = False) -> list[Path]:
    """Return the examples to run."""
    drawn = json.loads(_DIGESTS.read_text(encoding="utf-8")) if _DIGESTS.exists() else {}
    return [
        example
        for example in EXAMPLES
        if all_of_them or drawn.get(example.stem) != digest(example) or not (FOLDER / f"{example.stem}.png").exists()
    ]


def draw(examples: list[Path]) -> None:
    """Run examples, and remember by which source their pictures were drawn."""
    FOLDER.mkdir(exist_ok=True)
    sys.path.insert(0, str(SOURCES))
    for example in examples:
        print(f"{example.name}:")
        spec = importlib.util.spec_from_file_location(f"example_{example.stem}", example)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        module.main(FOLDER)
        drawn = json.loads(_DIGESTS.read_text(encoding="utf-8")) if _DIGESTS.exists() else {}
        _DIGESTS.write_text(json.dumps(drawn | {example.stem: digest(example)}, indent=1), encoding="utf-8")


def _draw_missing(app) -> None:
    """Draw what is missing in a process of its own, for this one does without compiled code."""
    from sphinx.errors import ExtensionError

    if not stale():
        return
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_DISABLE_JIT"}
    done = subprocess.run(
        [sys.executable, __file__], env=environment, capture_output=True, text=True, check=False
    )  # fmt: skip
    if done.returncode:
        raise ExtensionError(f"cannot draw the gallery: {done.stderr.strip()}")


def setup(app):
    """Draw the pictures before the pages are read."""
    app.connect("builder-inited", _draw_missing)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    draw(stale("--all" in sys.argv[1:]))
