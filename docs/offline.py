"""Sphinx extension: fails the build where a page would load anything from the network; links to follow are fine."""

import re
from html.parser import HTMLParser
from pathlib import Path

from sphinx.errors import ExtensionError

FOREIGN = re.compile(r"\s*(https?:)?//", re.IGNORECASE)
FOLLOWED = {"alternate", "author", "canonical", "help", "license", "next", "prev", "search"}
"""Relations of a <link> that name a place and load nothing."""


class _Loads(HTMLParser):
    """Collects the addresses that a browser fetches by itself."""

    def __init__(self, page: str):
        super().__init__()
        self.found: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        given = {name: value or "" for name, value in attributes}
        loads = [given.get(name, "") for name in ("src", "srcset", "poster", "data")]
        if tag in ("image", "use") or (tag == "link" and not set(given.get("rel", "").split()) & FOLLOWED):
            loads += [given.get("href", ""), given.get("xlink:href", "")]
        self.found += [address for address in loads if FOREIGN.match(address)]


def fetched(path: Path) -> list[str]:
    """Give the addresses on other machines that a page or a style sheet has a browser fetch."""
    text = path.read_text(encoding="utf-8")
    found = re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", text)
    return found + (_Loads(text).found if path.suffix == ".html" else [])


def _check(app, exception) -> None:
    if exception is not None or app.builder.format != "html":
        return
    out = Path(app.outdir)
    foreign = [
        f"{path.relative_to(out)}: {address}"
        for kind in ("html", "css")
        for path in sorted(out.rglob(f"*.{kind}"))
        for address in fetched(path)
    ]
    if foreign:
        raise ExtensionError(f"pages load from the network: {', '.join(foreign[:5])}; ship it with the documentation")


def setup(app) -> dict:
    app.connect("build-finished", _check)
    return {"parallel_read_safe": True}
