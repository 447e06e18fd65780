"""A policy as it is shipped: a folder with its ONNX models and a page of JSON that describes and seals them.

Nothing here unpickles or runs what it reads: files are bounded in size, compared with their SHA-256, and handed to ONNX
Runtime as bytes. The digests guard against damage and mix-ups; they are no signature.
"""

import hashlib
import json
import math
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import onnxruntime

from contactsafe.envs.tasks import OBSERVED
from contactsafe.errors import BundleError, InvalidInputError
from contactsafe.learning.perception import LEARNED, REPRESENTATIONS, open_session
from contactsafe.learning.scan import Scan
from contactsafe.processes import Independent

FORMAT = 3
"""Version of the folder's layout; raised when an older reader would misread it."""

FOLDER = "bundle"
"""Where a run leaves its bundle, within its own folder."""

MANIFEST = "bundle.json"
ENCODER, POLICY = "encoder.onnx", "policy.onnx"
MAX_MANIFEST_BYTES = 1_000_000
MAX_MODEL_BYTES = 16_000_000

MAX_LATENT = 4096

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
    "scan": dict,
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
    return Path(str(resources.files("contactsafe.learning") / "bundles" / "wiping"))


def digest(data):
    """Give the SHA-256 of bytes as 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


@dataclass(frozen=True)
class Bundle(Independent):
    """A checked bundle, its models running in ONNX Runtime.

    Attributes:
        folder: where it was read.
        manifest: bundle.json as it stands.
        encoder: session: "mask" (N, size, size) uint8 to "latent" (N, latent_size) float32; None for foveated pictures,
            which are computed, not learned.
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
            BundleError: a file is missing, too large, damaged or not what bundle.json says; the format is another; a
                model has other inputs and outputs, keeps weights outside its file or needs operators beyond ONNX's own.
        """
        folder = Path(folder)
        if not (folder / MANIFEST).is_file():
            raise BundleError(_what_is_there(folder))
        manifest = _read_manifest(folder)
        latent = ("float", [manifest["latent_size"]])
        encoder = None
        if manifest["representation"] in LEARNED:
            encoder = _read_model(folder, ENCODER, manifest["files"])
            size = manifest["view_size"]
            _check_ports(folder / ENCODER, encoder, {"mask": ("uint8", [size, size])}, {"latent": latent})
        policy = _read_model(folder, POLICY, manifest["files"])
        state = ("float", [sum(OBSERVED[name] for name in manifest["observes"])])
        inputs = {"state": state, "latent": latent}
        _check_ports(folder / POLICY, policy, inputs, {"action": ("float", [len(ACTIONS)])})
        return cls(folder, manifest, encoder, policy)

    @property
    def scan(self):
        """The motion laid over its actions."""
        return Scan(**self.manifest["scan"])

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
    if (run / "vae.json").is_file():
        return f"{run} holds eyes, not a policy; run `contactsafe train ppo --vae {run}`, which leaves a bundle"
    if (run / "checkpoint.pt").is_file():
        return (
            f"the run in {run} has left no bundle yet; once it is stopped, the command that began it, with --resume "
            "--max-minutes 0.1, has it leave what it has learned"
        )
    if not folder.is_dir():
        return f"no bundle at {folder}: not a folder; give the path of a folder that holds {MANIFEST}"
    return f"{folder / MANIFEST} is missing; the bundle is incomplete, copy or export it anew"


def _read_bounded(path, limit):
    if not path.is_file():
        raise BundleError(f"{path} is missing; the bundle is incomplete, copy or export it anew")
    size = path.stat().st_size
    if size > limit:
        raise BundleError(f"{path} has {size} bytes, at most {limit} are allowed; this is not a bundle of ours")
    return path.read_bytes()


def _read_manifest(folder):
    path = folder / MANIFEST
    try:
        manifest = json.loads(_read_bounded(path, MAX_MANIFEST_BYTES))
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path} is not JSON; the bundle is damaged, copy or export it anew") from error
    if not isinstance(manifest, dict):
        raise BundleError(f"{path} is not a JSON object; the bundle is damaged, copy or export it anew")
    version = manifest.get("format")
    if version != FORMAT:
        raise BundleError(f"{path} has format {version!r}, this version reads {FORMAT}; export it anew, or upgrade")
    for name, kind in FIELDS.items():
        value = manifest.get(name)
        fits = isinstance(value, (int, float) if kind is float else kind) and not isinstance(value, bool)
        if not fits:
            raise BundleError(f"{path}: {name} is {value!r}, not {kind.__name__}; export the bundle anew")
    if manifest["representation"] not in REPRESENTATIONS:
        allowed = ", ".join(REPRESENTATIONS)
        raise BundleError(f"{path}: representation is {manifest['representation']!r}, not one of {allowed}")
    try:
        Scan(**manifest["scan"])
    except (TypeError, InvalidInputError) as error:
        raise BundleError(f"{path}: scan is {manifest['scan']!r}; export the bundle anew") from error
    observes = manifest["observes"]
    if not all(isinstance(name, str) and name in OBSERVED for name in observes) or len(set(observes)) < len(observes):
        raise BundleError(f"{path}: observes is {observes!r}, not some of {', '.join(OBSERVED)}; export it anew")
    if manifest["actions"] != list(ACTIONS):
        raise BundleError(f"{path}: actions are not those of this version's task; export the bundle anew, or upgrade")
    for name, low, high in (
        ("window_m", 0.01, 10.0),
        ("view_size", 8, 1024),
        ("latent_size", 1, MAX_LATENT),
        ("rate_hz", 0.1, 1000.0),
        ("action_repeat", 1, 100),
    ):
        if not (math.isfinite(manifest[name]) and low <= manifest[name] <= high):
            raise BundleError(f"{path}: {name} = {manifest[name]} is outside [{low}, {high}]; export the bundle anew")
    return manifest


def _read_model(folder, name, files):
    path = folder / name
    data = _read_bounded(path, MAX_MODEL_BYTES)
    entry = files.get(name)
    if not isinstance(entry, dict) or entry.get("bytes") != len(data) or entry.get("sha256") != digest(data):
        raise BundleError(
            f"{path} is not the file {MANIFEST} was written for (size or SHA-256 differ); "
            "copy or export the bundle anew"
        )
    if b"location" in data:
        # The key under which ONNX names a file that holds weights. What we export has no such word anywhere.
        raise BundleError(f"{path} keeps weights in another file; export it with the weights inside")
    return open_session(data, str(path))


def _check_ports(path, session, inputs, outputs):
    for side, wanted, found in (("input", inputs, session.get_inputs()), ("output", outputs, session.get_outputs())):
        have = {port.name: (port.type, port.shape) for port in found}
        for name, (kind, tail) in wanted.items():
            if name not in have or have[name][0] != f"tensor({kind})" or list(have[name][1][1:]) != tail:
                raise BundleError(
                    f"{path}: {side} {name} is {have.get(name, 'absent')}, not tensor({kind}) of shape (N, "
                    f"{', '.join(map(str, tail))}); export the bundle anew"
                )
            if isinstance(have[name][1][0], int):
                raise BundleError(f"{path}: {side} {name} has a fixed batch size; export it with a free one")
        if len(have) != len(wanted):
            raise BundleError(f"{path}: {side}s are {sorted(have)}, not {sorted(wanted)}; export the bundle anew")


def blank_observation(manifest, n=1):
    """Make an observation of an empty board, to try a policy out: vectors (n, k) float32, mask (n, m, m, 1) uint8."""
    side = 128 if manifest["representation"] == "tool" else manifest["view_size"]
    vectors = {name: np.zeros((n, size), np.float32) for name, size in OBSERVED.items()}
    return {**vectors, "mask": np.full((n, side, side, 1), 255, np.uint8)}
