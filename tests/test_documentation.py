"""The documentation shows equations, and all else, to a reader without a network."""

import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(autouse=True)
def extensions(monkeypatch):
    pytest.importorskip("ziamath")
    monkeypatch.syspath_prepend(str(DOCS))
    yield
    for name in ("equations", "offline"):
        sys.modules.pop(name, None)


def written():
    for page in sorted(DOCS.rglob("*.md")):
        text = re.sub(r"```.*?```|`[^`]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for block in re.findall(r"\$\$(.*?)\$\$", text, re.DOTALL):
            yield block, False
        for inline in re.findall(r"\$([^$\n]+)\$", re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)):
            yield inline, True


def test_every_equation_is_drawn_without_script_font_or_network():
    from equations import draw

    equations = dict.fromkeys(written())
    assert len(equations) > 100
    for latex, inline in equations:
        svg, _ = draw(latex, inline)
        assert svg.count("<path") >= 1, latex
        assert not re.search(r"<text|<script|href|\bid=", svg), latex


def test_an_equation_that_cannot_be_drawn_fails_the_build():
    from equations import draw
    from sphinx.errors import ExtensionError

    with pytest.raises(ExtensionError, match=r"cannot draw the equation '\\\\frac\{1'"):
        draw(r"\frac{1", inline=True)


def test_the_number_of_an_equation_stands_beside_it():
    from equations import draw

    assert draw(r"a = b \tag{18, 22}", inline=False)[1] == "18, 22"


@pytest.mark.parametrize(
    ("name", "text", "found"),
    [
        ("a.html", '<script src="https://cdn.example/mathjax.js"></script>', ["https://cdn.example/mathjax.js"]),
        ("a.html", '<link rel="stylesheet" href="//cdn.example/a.css">', ["//cdn.example/a.css"]),
        ("a.html", '<img src="http://cdn.example/a.png">', ["http://cdn.example/a.png"]),
        (
            "a.html",
            '<style>body { background: url("https://cdn.example/b.png") }</style>',
            ["https://cdn.example/b.png"],
        ),
        ("a.css", "@import 'https://cdn.example/font.css';", ["https://cdn.example/font.css"]),
        ("a.html", '<a href="https://example.org">there</a><link rel="canonical" href="https://example.org">', []),
        ("a.html", '<script src="_static/a.js"></script><img src="data:image/png;base64,AA//">', []),
    ],
)
def test_what_a_page_loads_from_the_network_is_found(name, text, found, tmp_path):
    from offline import fetched

    (tmp_path / name).write_text(text, encoding="utf-8")
    assert fetched(tmp_path / name) == found
