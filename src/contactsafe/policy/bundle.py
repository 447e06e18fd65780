"""A policy as it is shipped: a folder with its ONNX models and a page of JSON that describes and seals them.

Nothing here unpickles or runs what it reads: files are bounded in size, compared with their SHA-256, read whole and
checked (`policy.graph`), and handed to ONNX Runtime as bytes. The digests guard against damage and mix-ups; they are
no signature.
"""

import hashlib
import json
import os
import stat
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import onnxruntime

from contactsafe.core.copying import Independent
from contactsafe.core.errors import BundleError, InvalidInputError, shown
from contactsafe.policy.dither import Dither
from contactsafe.policy.graph import check_ports, read_graph
from contactsafe.policy.observation import OBSERVED
from contactsafe.policy.perception import LEARNED, REPRESENTATIONS, encoder_ports, open_session
from contactsafe.vision.log_polar import FEATURES

FORMAT = 4
"""Version of the folder's layout; raised when an older reader would misread it."""

FOLDER = "bundle"
"""Where a run leaves its bundle, within its own folder."""

MANIFEST = "bundle.json"
ENCODER, POLICY = "encoder.onnx", "policy.onnx"
MAX_MANIFEST_BYTES = 1_000_000
MAX_MODEL_BYTES = 16_000_000

MAX_LATENT = 4096

BOUNDS = {
    "window_m": (0.01, 10.0),
    "view_size": (8, 1024),
    "rate_hz": (0.1, 1000.0),
    "action_repeat": (1, 100),
}
"""Numbers of bundle.json and what they may be."""

ACTIONS = tuple(
    f"{group}_{axis}"
    for group in ("x_d", "K_task", "D_task")
    for axis in ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
)
"""What each of the 18 actions increments, in order; each in [-1, 1]."""

FIELDS = {
    "format": int,
    "task": str,
    "representation": str,
    "window_m": float,
    "view_size": int,
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


def shipped_bundle():
    """Give the folder of the wiping policy that comes with the package."""
    return Path(str(resources.files("contactsafe.policy") / "bundles" / "wiping"))


def digest(data):
    """Give the SHA-256 of bytes as 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


@dataclass(frozen=True)
class Bundle(Independent):
    """A checked bundle, its models running in ONNX Runtime.

    Attributes:
        folder: where it was read.
        manifest: bundle.json as it stands.
        encoder: session: "mask" (N, size, size) uint8 to "latent" (N, latent_size) float32; None for log-polar
            features, which are computed, not learned.
        policy: session: "state" (N, k), the vectors it observes one after the other, and "latent" (N, latent_size),
            float32, to "action" (N, 18) float32 in [-1, 1].
    """

    folder: Path
    manifest: dict
    encoder: onnxruntime.InferenceSession | None
    policy: onnxruntime.InferenceSession

    @classmethod
    def load(cls, folder):
        """Read and check a bundle.

        Args:
            folder: its folder.

        Returns:
            The Bundle; every check below has passed.

        Raises:
            BundleError: a file is missing, too large, unreadable, a link to elsewhere, damaged or not what bundle.json
                says; the format is another; a model has other inputs and outputs, or more than `policy.graph` allows.
        """
        folder = Path(folder)
        try:
            missing = None if (folder / MANIFEST).exists() else _what_is_there(folder)
        except OSError as error:
            raise BundleError(f"{folder} cannot be read: {error.strerror}; check who may read it") from None
        if missing:
            raise BundleError(missing)
        manifest = _read_manifest(folder)
        encoder = None
        if manifest["representation"] in LEARNED:
            ports = encoder_ports(manifest["view_size"], manifest["latent_size"])
            encoder = _read_model(folder, ENCODER, manifest["files"], *ports)
        state = ("float", [sum(OBSERVED[name] for name in manifest["observes"])])
        latent = ("float", [manifest["latent_size"]])
        ports = {"state": state, "latent": latent}, {"action": ("float", [len(ACTIONS)])}
        policy = _read_model(folder, POLICY, manifest["files"], *ports)
        return cls(folder, manifest, encoder, policy)

    @property
    def dither(self):
        """The motion laid over its actions."""
        return Dither(**self.manifest["dither"])

    @property
    def rate_hz(self):
        """Observations a second the policy was trained at."""
        return float(self.manifest["rate_hz"])

    @property
    def action_repeat(self):
        """Environment steps for which one action is given."""
        return int(self.manifest["action_repeat"])


def _what_is_there(folder):
    """Say what a folder that has no manifest is, and what to do."""
    if (folder / FOLDER / MANIFEST).is_file():
        return f"{folder} is a run; give its bundle, {folder / FOLDER}"
    run = folder.parent if folder.name == FOLDER else folder
    if (run / "encoder.json").is_file():
        return (
            f"{run} holds a vision encoder, not a policy; run `contactsafe train ppo --encoder {run}`, which leaves a "
            "bundle"
        )
    if (run / "checkpoint.pt").is_file():
        return (
            f"the run in {run} has left no bundle yet; once it is stopped, the command that began it, with --resume "
            "--max-minutes 0.1, has it leave what it has learned"
        )
    if not folder.is_dir():
        return f"no bundle at {folder}: not a folder; give the path of a folder that holds {MANIFEST}"
    return f"{folder / MANIFEST} is missing; the bundle is incomplete, copy or export it anew"


def read_bounded(folder, name, limit):
    """Read a file that lies in a folder (a Path), of at most so many bytes.

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


def _read_manifest(folder):
    path = folder / MANIFEST
    try:
        manifest = json.loads(read_bounded(folder, MANIFEST, MAX_MANIFEST_BYTES), object_pairs_hook=_once)
    except _TwiceError as twice:
        raise BundleError(
            f"{path} says {shown(str(twice))} twice; the bundle is damaged, copy or export it anew"
        ) from None
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path} is not JSON; the bundle is damaged, copy or export it anew") from error
    if not isinstance(manifest, dict):
        raise BundleError(f"{path} is not a JSON object; the bundle is damaged, copy or export it anew")
    version = manifest.get("format")
    if version != FORMAT:
        raise BundleError(
            f"{path} has format {shown(version)}, this version reads {FORMAT}; export it anew, or upgrade"
        )
    for name, kind in FIELDS.items():
        value = manifest.get(name)
        fits = isinstance(value, (int, float) if kind is float else kind) and not isinstance(value, bool)
        if not fits:
            raise BundleError(f"{path}: {name} is {shown(value)}, not {kind.__name__}; export the bundle anew")
    if manifest["representation"] not in REPRESENTATIONS:
        allowed = ", ".join(REPRESENTATIONS)
        raise BundleError(f"{path}: representation is {shown(manifest['representation'])}, not one of {allowed}")
    try:
        Dither(**manifest["dither"])
    except (TypeError, InvalidInputError) as error:
        raise BundleError(f"{path}: dither is {shown(manifest['dither'])}; export the bundle anew") from error
    observes = manifest["observes"]
    if not all(isinstance(name, str) and name in OBSERVED for name in observes) or len(set(observes)) < len(observes):
        raise BundleError(f"{path}: observes is {shown(observes)}, not some of {', '.join(OBSERVED)}; export it anew")
    if manifest["actions"] != list(ACTIONS):
        raise BundleError(f"{path}: actions are not those of this version's task; export the bundle anew, or upgrade")
    latent = (1, MAX_LATENT) if manifest["representation"] in LEARNED else (FEATURES, FEATURES)
    for name, (low, high) in {**BOUNDS, "latent_size": latent}.items():
        if not low <= manifest[name] <= high:
            raise BundleError(
                f"{path}: {name} = {shown(manifest[name])} is outside [{low}, {high}]; export the bundle anew"
            )
    return manifest


class _TwiceError(ValueError):
    """A name that stands twice in one object."""


def _once(pairs):
    found = {}
    for name, value in pairs:
        if name in found:
            raise _TwiceError(name)
        found[name] = value
    return found


def _read_model(folder, name, files, inputs, outputs):
    """Read one of the models, and start it once it is known to be what bundle.json says and to have these ports."""
    path = folder / name
    data = read_bounded(folder, name, MAX_MODEL_BYTES)
    entry = files.get(name)
    if not isinstance(entry, dict) or entry.get("bytes") != len(data) or entry.get("sha256") != digest(data):
        raise BundleError(
            f"{path} is not the file {MANIFEST} was written for (size or SHA-256 differ); "
            "copy or export the bundle anew"
        )
    graph = read_graph(data, str(path))
    check_ports(graph, str(path), inputs, outputs)
    return open_session(graph, str(path))


def blank_observation(manifest, n=1):
    """Make an observation of an empty board, to try a policy out: vectors (n, k) float32, mask (n, m, m, 1) uint8."""
    side = 128 if manifest["representation"] == "tool" else manifest["view_size"]
    vectors = {name: np.zeros((n, size), np.float32) for name, size in OBSERVED.items()}
    return {**vectors, "mask": np.full((n, side, side, 1), 255, np.uint8)}
