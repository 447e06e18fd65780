"""Sphinx settings. Build: make docs."""

import inspect
import os
import pathlib
import re
import sys

# Compiled functions are documented from their Python source.
os.environ["NUMBA_DISABLE_JIT"] = "1"

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import controller_tables

import contactsafe

project = "contactsafe"
author = "the contactsafe authors"
release = version = contactsafe.__version__

extensions = [
    "equations",
    "offline",
    "pictures",
    "myst_parser",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build"]

html_theme = "furo"
html_static_path = ["static"]
html_math_renderer = "drawn"
html_title = f"contactsafe {release}"

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3

apidoc_modules = [
    {
        "path": "../src/contactsafe",
        "destination": "api",
        "exclude_patterns": ["../src/contactsafe/cli", "../src/contactsafe/__main__.py"],
        "separate_modules": True,
        "module_first": True,
        "max_depth": 1,
        "automodule_options": {"members", "show-inheritance"},
    }
]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True


def _plain_text(app, what, name, obj, options, lines):
    """Take docstrings as plain text: `|x|`, `J_t*` and `x_` are mathematics, not markup."""
    for index, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [re.sub(r"([|*])|(?<=\w)(_)(?!\w)", r"\\\g<0>", part) for part in parts[::2]]
        lines[index] = "".join(parts)
    if what in ("data", "attribute"):
        lines.insert(0, "")  # or napoleon would read "Edges: of the classes" as a type and its description


def _skip(app, what, name, obj, skip, options):
    """Leave out what is documented elsewhere.

    Fields of a NamedTuple stand under Attributes; what a package passes on from its modules stands with the module.
    """
    if type(obj).__name__ == "_tuplegetter":
        return True
    page = app.env.docname.removeprefix("api/")
    passed_on = what == "module" and (inspect.isclass(obj) or inspect.isfunction(obj)) and obj.__module__ != page
    return True if passed_on else None


def _fill_tables(app, docname, source):
    """Write the tables that come from the code."""
    if docname == "concepts/control":
        source[0] = controller_tables.fill(source[0])


def setup(app):
    app.connect("source-read", _fill_tables)
    app.connect("autodoc-process-docstring", _plain_text, priority=100)
    app.connect("autodoc-skip-member", _skip)
