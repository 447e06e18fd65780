"""A policy as it is shipped: a folder with its ONNX models and a page of JSON that describes and seals them.

Nothing here unpickles or runs what it reads: files are bounded in size, compared with their SHA-256, read whole and
checked (`onnx_graph`), and handed to ONNX Runtime as bytes. The digests guard against damage and mix-ups; they are
no signature.
"""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from contactsafe.core.copying import Independent
from contactsafe.core.errors import BundleError
from contactsafe.policy.action_config import ACTIONS
from contactsafe.policy.conditions import Conditions
from contactsafe.policy.dither import Dither
from contactsafe.policy.manifest import MANIFEST, digest, read_bounded, read_manifest
from contactsafe.policy.onnx_graph import Ports, check_ports, read_graph
from contactsafe.policy.perception import LEARNED, NO_IMAGE, encoder_ports, open_session

FOLDER = "bundle"
"""Where a run leaves its bundle, within its own folder."""

ENCODER, POLICY = "encoder.onnx", "policy.onnx"
ENCODER_DESCRIPTION = "encoder.json"
MAX_MODEL_BYTES = 16_000_000


def shipped_bundle(task: str) -> Path:
    """Return the folder of the policy for a task, by its name, that comes with the package.

    Raises:
        BundleError: none does.
    """
    folder = Path(str(resources.files("contactsafe.policy") / "bundles" / task))
    if not folder.is_dir():
        raise BundleError(f"no policy is shipped for task '{task}'; give the folder of a bundle")
    return folder


@dataclass(frozen=True)
class Bundle(Independent):
    """A checked bundle, its models running in ONNX Runtime.

    Attributes:
        folder: where it was read.
        manifest: bundle.json as it stands.
        encoder: session: "mask" (N, size, size) uint8 to "latent" (N, latent_size) float32; None where none is learned.
        policy: session: "state" (N, k), the vectors it observes one after the other, and "latent" (N, latent_size)
            where it sees images, float32, to "action" (N, 18) float32 in [-1, 1].
    """

    folder: Path
    manifest: dict[str, Any]
    encoder: onnxruntime.InferenceSession | None
    policy: onnxruntime.InferenceSession

    @classmethod
    def load(cls, folder: Path | str) -> "Bundle":
        """Read and check a bundle.

        Args:
            folder: its folder.

        Returns:
            The Bundle; every check below has passed.

        Raises:
            BundleError: a file is missing, too large, unreadable, a link to elsewhere, damaged or not what bundle.json
                says; the format is another; a model has other inputs and outputs, or more than `onnx_graph` allows.
        """
        folder = Path(folder)
        try:
            missing = None if (folder / MANIFEST).exists() else _what_is_there(folder)
        except OSError as error:
            raise BundleError(f"{folder} cannot be read: {error.strerror}; check who may read it") from None
        if missing:
            raise BundleError(missing)
        manifest = read_manifest(folder)
        encoder = None
        if manifest["representation"] in LEARNED:
            ports = encoder_ports(manifest["view_size"], manifest["latent_size"])
            encoder = _read_model(folder, ENCODER, manifest["files"], *ports)
        policy = _read_model(folder, POLICY, manifest["files"], *_policy_ports(manifest))
        return cls(folder, manifest, encoder, policy)

    @property
    def observes(self) -> dict[str, int]:
        """Vectors that the policy observes: size by name, in the order in which its network takes them."""
        return {vector["name"]: vector["size"] for vector in self.manifest["observes"]}

    @property
    def sees(self) -> bool:
        """Whether the policy sees images."""
        return self.manifest["representation"] != NO_IMAGE

    @property
    def dither(self) -> Dither:
        """The motion added to its actions."""
        return Dither(**self.manifest["dither"])

    @property
    def conditions(self) -> Conditions:
        """What it is to be run with."""
        return Conditions(**self.manifest["conditions"])

    @property
    def rate_hz(self) -> float:
        """Observations a second the policy was trained at."""
        return float(self.manifest["rate_hz"])

    @property
    def action_repeat(self) -> int:
        """Environment steps for which one action is given."""
        return int(self.manifest["action_repeat"])


def _policy_ports(manifest: dict[str, Any]) -> tuple[Ports, Ports]:
    inputs: Ports = {"state": ("float", [sum(vector["size"] for vector in manifest["observes"])])}
    if manifest["representation"] != NO_IMAGE:
        inputs["latent"] = ("float", [manifest["latent_size"]])
    return inputs, {"action": ("float", [len(ACTIONS)])}


def _what_is_there(folder: Path) -> str:
    """Say what a folder that has no manifest is, and what to do."""
    if (folder / FOLDER / MANIFEST).is_file():
        return f"{folder} is a run; give its bundle, {folder / FOLDER}"
    run = folder.parent if folder.name == FOLDER else folder
    if (run / ENCODER_DESCRIPTION).is_file():
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


def _read_model(
    folder: Path, name: str, files: dict[str, Any], inputs: Ports, outputs: Ports
) -> onnxruntime.InferenceSession:
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


def blank_observation(bundle: Bundle, n: int = 1) -> dict[str, np.ndarray]:
    """Return an observation of zeros to try a policy with: vectors (n, k) float32, blank mask (n, m, m, 1) uint8."""
    observation = {name: np.zeros((n, size), np.float32) for name, size in bundle.observes.items()}
    observation.setdefault("pose", np.zeros((n, 6), np.float32))
    if bundle.sees:
        side = 128 if bundle.manifest["representation"] == "tool" else bundle.manifest["view_size"]
        observation["mask"] = np.full((n, side, side, 1), 255, np.uint8)
    return observation
