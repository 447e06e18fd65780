"""What a clone and a wheel must hold: pins, versions, and nothing of the machine they were made on."""

import pathlib
import re
import subprocess
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import contactsafe

ROOT = pathlib.Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def tracked_files() -> list[pathlib.Path]:
    try:
        done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git clone")
    return [path for name in done.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def pins() -> dict[str, Requirement]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    requirements = [Requirement(line) for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(requirement.name): requirement for requirement in requirements}


def test_every_dependency_is_pinned_within_its_range():
    pinned = pins()
    extras = PROJECT["optional-dependencies"].values()
    for line in [*PROJECT["dependencies"], *(line for extra in extras for line in extra)]:
        wanted = Requirement(line)
        pin = pinned.get(canonicalize_name(wanted.name))
        assert pin is not None, f"{wanted.name} has no line in constraints.txt"
        version = str(pin.specifier).removeprefix("==")
        assert wanted.specifier.contains(version), f"constraints.txt: {pin} is outside {wanted}"


def test_pins_are_exact_and_public():
    for pin in pins().values():
        assert re.fullmatch(r"==[0-9a-z.]+", str(pin.specifier)), f"{pin}: not an exact public version"
        assert pin.url is None


def test_version_is_the_same_everywhere():
    assert contactsafe.__version__ == PROJECT["version"]
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## \[{re.escape(PROJECT['version'])}\]", changelog, re.MULTILINE)


def test_license_is_complete():
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Version 2.0, January 2004" in text
    assert "END OF TERMS AND CONDITIONS" in text


# Written in pieces so that this file passes its own test.
_FOLDERS = "|".join(["work", "tmp", "root", "home"])
_HOSTS = "|".join(
    [r"py" + r"pi\.org", "pythonhosted", r"download\.py" + "torch", r"npm" + r"js\.org", r"deb" + r"ian\.org"]
)
MACHINE_PATH = re.compile(rb"(?<![\w.\-/~}$)<])/(?:" + _FOLDERS.encode() + rb")/[\w.]")
REGISTRY_HOST = re.compile(
    rb"https?://[\w.\-]*(?:" + _HOSTS.encode() + rb")|(?:extra-)?index" + rb"-url|find" + rb"-links"
)


@pytest.mark.parametrize("pattern", [MACHINE_PATH, REGISTRY_HOST], ids=["paths", "hosts"])
def test_tracked_files_do_not_name_a_machine(pattern):
    """Binary files too: an exported network can carry the paths of the code that made it."""
    found = []
    for path in tracked_files():
        match = pattern.search(path.read_bytes())
        if match:
            found.append(f"{path.relative_to(ROOT)}: {match.group().decode(errors='replace')}")
    assert found == []


def test_no_tracked_file_is_generated():
    generated = re.compile(r"(^|/)(__pycache__|build|\.venv[^/]*)(/|$)|\.(pyc|nbi|nbc)$")
    assert [str(p) for p in tracked_files() if generated.search(str(p.relative_to(ROOT)))] == []
