"""Sizes of the source by room against their limits: modules, functions, parameters, docstrings, annotations, tests.

    python tools/sizes.py            a row a room, then what exceeds a limit; exit status 1 if anything does
    python tools/sizes.py --all      every offender by name, also those that only an average counts

Lines are those of the file, docstrings, comments and blank lines with them; a function's begin at its `def`.
"""

import argparse
import ast
import math
import pathlib
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field

LIMITS = {
    "module, median": 130,
    "module, longest": 330,
    "function, p90": 25,
    "function, longest": 60,
    "parameters, most": 8,  # of functions that are not compiled
    "docstrings, %": 100,  # at least, of what is public
    "annotations, %": 100,  # at least, of public functions
    "tests / source": 0.6,  # at least, in every room
    "tests / source, total": 0.8,  # at least
    "Markdown line": 120,
}

ROOT = pathlib.Path(__file__).resolve().parents[1]
SOURCE, TESTS = ROOT / "src" / "contactsafe", ROOT / "tests"
COMPILED = {"compiled", "inlined", "njit", "cfunc"}
"""Decorators of compiled functions, which take bundles of arrays."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Room:
    """Sizes found in one room.

    Attributes:
        modules: lines of each file.
        functions: lines of each function.
        parameters: number of parameters of each function that is not compiled.
        docstrings: whether each public module, class and function has one.
        annotations: whether each public function has all of them.
        test_lines: lines of the room's tests.
    """

    modules: dict[str, int] = field(default_factory=dict)
    functions: dict[str, int] = field(default_factory=dict)
    parameters: dict[str, int] = field(default_factory=dict)
    docstrings: dict[str, bool] = field(default_factory=dict)
    annotations: dict[str, bool] = field(default_factory=dict)
    test_lines: int = 0

    def add(self, other: "Room") -> None:
        """Count another room's sizes too."""
        for name in ("modules", "functions", "parameters", "docstrings", "annotations"):
            getattr(self, name).update(getattr(other, name))
        self.test_lines += other.test_lines

    def figures(self) -> dict[str, float]:
        """Return what LIMITS bounds."""
        modules, functions = list(self.modules.values()), sorted(self.functions.values()) or [0]
        return {
            "module, median": statistics.median(modules),
            "module, longest": max(modules),
            "function, p90": functions[math.ceil(0.9 * len(functions)) - 1],
            "function, longest": functions[-1],
            "parameters, most": max(self.parameters.values(), default=0),
            "docstrings, %": _percent(self.docstrings),
            "annotations, %": _percent(self.annotations),
            "tests / source": self.test_lines / sum(modules),
        }


def main() -> int:
    """Print the table and what exceeds a limit; return 1 if anything does, else 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="name every function and file over a limit")
    everything = parser.parse_args().all
    rooms = {path.name: measured(path) for path in sorted(SOURCE.iterdir()) if (path / "__init__.py").exists()}
    total = Room()
    for room in [*rooms.values(), _root_modules()]:
        total.add(room)
    total.test_lines = _lines(TESTS.rglob("*.py"))
    _print_table({**rooms, "total": total})
    long_lines = list(_long_markdown_lines())
    print(f"\nMarkdown lines over {LIMITS['Markdown line']}: {len(long_lines)}")
    faults = [fault for name, room in rooms.items() for fault in _exceeded(name, room)]
    faults += [fault for fault in _exceeded("total", total) if "tests" in fault]
    if long_lines:
        faults.append(f"Markdown: {len(long_lines)} lines are too long")
    named = [*_offenders(total), *long_lines] if everything else []
    print("\n".join(["", *faults, *named] if faults else ["", "All within the limits."]))
    return 1 if faults else 0


def measured(folder: pathlib.Path) -> Room:
    """Return the sizes found in a folder and those below it."""
    room = Room(test_lines=_lines((TESTS / folder.name).rglob("*.py")))
    for path in sorted(folder.rglob("*.py")):
        room.add(_module(path))
    return room


def _root_modules() -> Room:
    """Return the sizes of the modules that stand in no room."""
    room = Room()
    for path in sorted(SOURCE.glob("*.py")):
        room.add(_module(path))
    return room


def _module(path: pathlib.Path) -> Room:
    """Return the sizes found in a file."""
    text, name = path.read_text(), str(path.relative_to(SOURCE))
    tree = ast.parse(text)
    room = Room(modules={name: text.count("\n")}, docstrings={name: ast.get_docstring(tree) is not None})
    for place, node, public in _definitions(tree, f"{name}:", True):
        special = node.name.startswith("__")
        if public and not special and not _is_setter(node):
            room.docstrings[place] = ast.get_docstring(node) is not None
        if isinstance(node, ast.ClassDef):
            continue
        room.functions[place] = (node.end_lineno or node.lineno) - node.lineno + 1
        if not _is_compiled(node):
            room.parameters[place] = len(_parameters(node))
        if public:
            room.annotations[place] = _is_annotated(node)
    return room


def _definitions(tree: ast.AST, place: str, public: bool) -> Iterator[tuple[str, Function | ast.ClassDef, bool]]:
    """Yield each class and function below a node, its name, and whether a user may call it."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, Function | ast.ClassDef):
            yield from _definitions(node, place, public)
            continue
        seen = public and (not node.name.startswith("_") or node.name.startswith("__"))
        yield f"{place}{node.lineno} {node.name}", node, seen
        yield from _definitions(node, place, seen and isinstance(node, ast.ClassDef))


def _is_compiled(function: Function) -> bool:
    """Tell whether a decorator compiles a function."""
    called = (node.func if isinstance(node, ast.Call) else node for node in function.decorator_list)
    return any(
        (node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")) in COMPILED for node in called
    )


def _is_setter(node: Function | ast.ClassDef) -> bool:
    """Tell whether this sets a property: help shows the docstring of what reads it, and never this one's."""
    return any(isinstance(decorator, ast.Attribute) and decorator.attr == "setter" for decorator in node.decorator_list)


def _parameters(function: Function) -> list[ast.arg]:
    """Return the parameters of a function but for `self` and `cls`."""
    declared = function.args
    found = [*declared.posonlyargs, *declared.args, *declared.kwonlyargs]
    found += [starred for starred in (declared.vararg, declared.kwarg) if starred]
    return [parameter for parameter in found if parameter.arg not in ("self", "cls")]


def _is_annotated(function: Function) -> bool:
    """Tell whether every parameter and the result of a function has its type."""
    returns = function.returns is not None or function.name == "__init__"
    return returns and all(parameter.annotation for parameter in _parameters(function))


def _long_markdown_lines() -> Iterator[str]:
    """Yield where lines of Markdown are too long."""
    pages = [
        *ROOT.glob("*.md"),
        *(page for folder in ("benchmarks", "docs", "examples") for page in (ROOT / folder).rglob("*.md")),
    ]
    for page in sorted(pages):
        for number, line in enumerate(page.read_text().splitlines(), 1):
            if len(line) > LIMITS["Markdown line"]:
                yield f"{page.relative_to(ROOT)}:{number} has {len(line)} characters"


def _print_table(rooms: dict[str, Room]) -> None:
    """Print a row a room."""
    print(f"{'':14}{'modules':>16}{'functions':>16}{'most':>12}{'docstrings':>12}{'annotated':>11}{'tests/':>9}")
    print(f"{'':14}{'median  longest':>16}{'p90  longest':>16}{'parameters':>12}{'%':>12}{'%':>11}{'source':>9}")
    for name, room in rooms.items():
        median, longest, p90, most, parameters, docstrings, annotations, tests = room.figures().values()
        print(
            f"{name:14}{median:7.0f}{longest:9.0f}{p90:7.0f}{most:9.0f}{parameters:12.0f}"
            f"{docstrings:12.1f}{annotations:11.1f}{tests:9.2f}"
        )


def _exceeded(name: str, room: Room) -> Iterator[str]:
    """Yield which figures of a room exceed their limits."""
    for figure, found in room.figures().items():
        limit = LIMITS.get(f"{figure}, {name}", LIMITS[figure])
        at_least = figure.startswith(("docstrings", "annotations", "tests"))
        if found < limit if at_least else found > limit:
            print_at = ".2f" if figure.startswith("tests") else ".4g"
            yield f"{name}: {figure} = {found:{print_at}}, limit {limit}"


def _offenders(total: Room) -> list[str]:
    """Return every file and function over a limit by name."""
    over = [
        *((place, found, "lines") for place, found in total.modules.items() if found > LIMITS["module, longest"]),
        *((place, found, "lines") for place, found in total.functions.items() if found > LIMITS["function, longest"]),
        *(
            (place, found, "parameters")
            for place, found in total.parameters.items()
            if found > LIMITS["parameters, most"]
        ),
    ]
    return (
        [f"{place} has {found} {what}" for place, found, what in over]
        + [f"{place} has no docstring" for place, found in total.docstrings.items() if not found]
        + [f"{place} is not annotated" for place, found in total.annotations.items() if not found]
    )


def _percent(found: dict[str, bool]) -> float:
    return 100.0 * sum(found.values()) / len(found) if found else 100.0


def _lines(paths: Iterator[pathlib.Path]) -> int:
    return sum(path.read_text().count("\n") for path in paths)


if __name__ == "__main__":
    sys.exit(main())
