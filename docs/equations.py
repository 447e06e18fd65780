"""Sphinx extension: equations drawn while the page is built; its readers need no script, no font, no network."""

import html
import re

import ziamath
from docutils import nodes
from sphinx.errors import ExtensionError

PX = 16.0
"""Height of the text that equations are drawn for, px; they are shown in em, and so grow with theirs."""


def draw(latex: str, inline: bool) -> tuple[str, str]:
    r"""Draw an equation.

    Args:
        latex: as in the page's source, with \tag{…} or without.
        inline: part of a line of text.

    Returns:
        An SVG element in the colour of the text around it, its baseline on theirs; the tag, or nothing.
    """
    tag = re.search(r"\\tag\{(.*?)\}", latex)
    bare = latex.replace(tag[0], "") if tag else latex
    # ziamath sets a sign like a difference, and leaves no room around a bar in a subscript.
    spaced = re.sub(r"(^|=\s*)-", r"\1{-}", bare.replace(r"\mid", r"\,|\,"))
    ziamath.config.svg2 = False  # no ids, which would meet those of other equations
    try:
        svg = ziamath.Latex(spaced.strip(), size=PX, color="currentColor", inline=inline).svg()
    except Exception as error:  # whatever its parser stumbles over
        raise ExtensionError(f"cannot draw the equation {latex!r}: {error}") from error
    left, top, width, height = map(float, re.search(r'viewBox="([^"]*)"', svg)[1].split())
    style = f"width:{width / PX:.3f}em;height:{height / PX:.3f}em"
    if inline:
        style += f";vertical-align:{-(top + height) / PX:.3f}em"
    inside = re.sub(r"(\.\d\d)\d+", r"\1", svg[svg.index(">") + 1 :])
    head = f'<svg class="equation" role="img" aria-label="{html.escape(bare.strip())}" style="{style}"'
    return f'{head} viewBox="{left} {top} {width} {height}">{inside}', tag[1] if tag else ""


def _inline(translator, node) -> None:
    translator.body.append(draw(node.astext(), inline=True)[0])
    raise nodes.SkipNode


def _block(translator, node) -> None:
    svg, tag = draw(node.astext(), inline=False)
    number = f"<span>({html.escape(tag)})</span>" if tag else ""
    translator.body.append(f'<div class="equation">{svg}{number}</div>\n')
    raise nodes.SkipNode


def setup(app) -> dict:
    app.add_html_math_renderer("drawn", (_inline, None), (_block, None))
    app.add_css_file("equations.css")
    return {"parallel_read_safe": True, "parallel_write_safe": True}
