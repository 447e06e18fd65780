"""bundle.json: what it must hold, and how it is read and checked before anything it names is opened."""

import hashlib
import json
import os
import stat
from pathlib import Path
from typing import Any

from contactsafe.core.errors import BundleError, InvalidInputError, shown
from contactsafe.policy.action_config import ACTIONS
from contactsafe.policy.conditions import Conditions
from contactsafe.policy.dither import Dither
from contactsafe.policy.perception import LEARNED, NO_IMAGE, REPRESENTATIONS
from contactsafe.vision.log_polar import FEATURES

FORMAT = 5
"""Version of the folder's layout; raised when an older reader would misread it."""

MANIFEST = "bundle.json"
MAX_MANIFEST_BYTES = 1_000_000
MAX_LATENT = 4096
MAX_OBSERVED = 1024
"""Most numbers in one observed vector."""

FIELDS: dict[str, type] = {
    "format": int,
    "task": str,
    "conditions": dict,
    "representation": str,
    "latent_size": int,
    "observes": list,
    "rate_hz": float,
    "action_repeat": int,
    "dither": dict,
    "actions": list,
    "observation_scaling": dict,
    "files": dict,
    "versions": dict,
    "training": dict,
    "results": dict,
}
"""Fields of bundle.json and their types."""

IMAGE_FIELDS: dict[str, type] = {"window_m": float, "view_size": int}
"""Those that it has besides where the policy sees images."""

BOUNDS = {
    "window_m": (0.01, 10.0),
    "view_size": (8, 1024),
    "rate_hz": (0.1, 1000.0),
    "action_repeat": (1, 100),
}
"""Numbers of bundle.json and what they may be."""


def digest(data: bytes) -> str:
    """Return the SHA-256 of bytes as 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read bundle.json and check every field that a reader relies on.

    Args:
        folder: of the bundle.

    Raises:
        BundleError: it is missing, not JSON, of another format, or a field is missing or cannot be.
    """
    path = folder / MANIFEST
    manifest = _parse(path, read_bounded(folder, MANIFEST, MAX_MANIFEST_BYTES))
    version = manifest.get("format")
    if version != FORMAT:
        raise BundleError(
            f"{path} has format {shown(version)}, this version reads {FORMAT}; export it anew, or upgrade"
        )
    _check_types(path, manifest, FIELDS)
    representation = manifest["representation"]
    if representation not in REPRESENTATIONS:
        allowed = ", ".join(REPRESENTATIONS)
        raise BundleError(f"{path}: representation is {shown(representation)}, not one of {allowed}")
    if representation != NO_IMAGE:
        _check_types(path, manifest, IMAGE_FIELDS)
    try:
        Dither(**manifest["dither"])
    except (TypeError, InvalidInputError) as error:
        raise BundleError(f"{path}: dither is {shown(manifest['dither'])}; export the bundle anew") from error
    try:
        Conditions(**manifest["conditions"])
    except (TypeError, InvalidInputError) as error:
        raise BundleError(f"{path}: conditions are {shown(manifest['conditions'])}; export the bundle anew") from error
    _check_observes(path, manifest["observes"])
    if manifest["actions"] != list(ACTIONS):
        raise BundleError(f"{path}: actions are not those of this version's tasks; export the bundle anew, or upgrade")
    _check_bounds(path, manifest)
    return manifest


def _parse(path: Path, data: bytes) -> dict[str, Any]:
    try:
        manifest = json.loads(data, object_pairs_hook=_once)
    except _TwiceError as twice:
        raise BundleError(
            f"{path} says {shown(str(twice))} twice; the bundle is damaged, copy or export it anew"
        ) from None
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path} is not JSON; the bundle is damaged, copy or export it anew") from error
    if not isinstance(manifest, dict):
        raise BundleError(f"{path} is not a JSON object; the bundle is damaged, copy or export it anew")
    return manifest


def _check_types(path: Path, manifest: dict[str, Any], fields: dict[str, type]) -> None:
    for name, kind in fields.items():
        value = manifest.get(name)
        fits = isinstance(value, (int, float) if kind is float else kind) and not isinstance(value, bool)
        if not fits:
            raise BundleError(f"{path}: {name} is {shown(value)}, not {kind.__name__}; export the bundle anew")


def _check_observes(path: Path, observes: list[Any]) -> None:
    """Refuse what is not a list of different names with their sizes."""
    fits = all(
        isinstance(vector, dict)
        and set(vector) == {"name", "size"}
        and isinstance(vector["name"], str)
        and type(vector["size"]) is int
        and 1 <= vector["size"] <= MAX_OBSERVED
        for vector in observes
    )
    if not fits or not observes or len({vector["name"] for vector in observes}) < len(observes):
        raise BundleError(
            f"{path}: observes is {shown(observes)}, not a list of names and sizes of vectors, each once; export the "
            "bundle anew"
        )


def _check_bounds(path: Path, manifest: dict[str, Any]) -> None:
    representation = manifest["representation"]
    least, most = (1, MAX_LATENT) if representation in LEARNED else 2 * (0 if representation == NO_IMAGE else FEATURES,)
    for name, (low, high) in {**BOUNDS, "latent_size": (least, most)}.items():
        if name in IMAGE_FIELDS and representation == NO_IMAGE:
            continue
        if not low <= manifest[name] <= high:
            raise BundleError(
                f"{path}: {name} = {shown(manifest[name])} is outside [{low}, {high}]; export the bundle anew"
            )


class _TwiceError(ValueError):
    """A name that stands twice in one object."""


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise _TwiceError(name)
        found[name] = value
    return found


def read_bounded(folder: Path, name: str, limit: int) -> bytes:
    """Read a file that lies in a folder, of at most so many bytes.

    Raises:
        BundleError: it is missing, too large, no file, a link out of the folder, or cannot be read.
    """
    path = folder / name
    try:
        real = path.resolve(strict=True)
        if real.parent != folder.resolve():
            raise BundleError(f"{path} is a link to another folder; copy the file itself")
        # Not to wait at a pipe, nor to be led elsewhere since.
        handle = os.open(real, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            found = os.fstat(handle)
            if not stat.S_ISREG(found.st_mode):
                raise BundleError(f"{path} is not a file; copy or export the bundle anew")
            if found.st_size > limit:
                raise BundleError(
                    f"{path} has {found.st_size} bytes, at most {limit} are allowed; this is not a bundle of ours"
                )
            with open(handle, "rb", closefd=False) as file:
                return file.read(limit)
        finally:
            os.close(handle)
    except FileNotFoundError:
        raise BundleError(f"{path} is missing; the bundle is incomplete, copy or export it anew") from None
    except (OSError, RuntimeError) as error:  # a RuntimeError is a circle of links
        reason = getattr(error, "strerror", None) or error
        raise BundleError(f"{path} cannot be read: {reason}; check who may read it") from None
