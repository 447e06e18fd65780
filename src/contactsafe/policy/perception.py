"""From an observation to the latent, the same in training, in evaluation and on the robot. No torch."""

import numpy as np
import onnxruntime

from contactsafe.core.copying import Independent, Threads
from contactsafe.core.errors import BundleError, InvalidInputError
from contactsafe.policy.onnx_graph import Graph, Ports, read_graph
from contactsafe.vision.log_polar import CHUNKS, FEATURES, ground_of, log_polar_features
from contactsafe.vision.rectify import rectify

PAPER = "paper"

LEARNED = ("tool", PAPER)
"""Representations that need a trained encoder: a β-VAE of the mask in the tool's frame, or in the camera's."""

NO_IMAGE = "none"
"""Representation of a policy that sees no images: its latent has no numbers."""

ENCODER_FORMAT = 4
"""Version of what encoder.json holds and of what its numbers mean."""

WITH_IMAGE = ("log_polar", *LEARNED)

REPRESENTATIONS = (*WITH_IMAGE, NO_IMAGE)


class _Session(onnxruntime.InferenceSession):
    """A session that copies and pickles as the bytes it was started on; copies check and start them again."""

    def __init__(self, model: bytes, name: str, options: onnxruntime.SessionOptions):
        super().__init__(model, options, providers=["CPUExecutionProvider"])
        self._opened = model, name, options.intra_op_num_threads

    def __reduce__(self) -> tuple:
        return open_session, self._opened

    def __copy__(self) -> "onnxruntime.InferenceSession":
        return open_session(*self._opened)


def open_session(model: bytes | Graph, name: str, threads: int = 1) -> onnxruntime.InferenceSession:
    """Start ONNX Runtime on a model held in memory, once it has been checked.

    Args:
        model: the file's bytes, or a Graph that was read from them.
        name: what to call it in errors.
        threads: for one operator; 1 keeps clear of the control loop's core.

    Raises:
        BundleError: the bytes are no ONNX model, or one with more than `policy.onnx_graph` allows.
    """
    graph = model if isinstance(model, Graph) else read_graph(model, name)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    # Threads that spin between calls would eat the core the controller runs on.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.load_model_format", "ONNX")
    try:
        return _Session(graph.model, name, options)
    except Exception as error:
        reason = str(error).splitlines()[0][:160]
        raise BundleError(f"{name} is not a model ONNX Runtime takes ({reason}); export the bundle anew") from error


def encoder_ports(size: int, latent_size: int) -> tuple[Ports, Ports]:
    """Return inputs and outputs of an encoder of images of so many pixels along a side."""
    return {"mask": ("uint8", [size, size])}, {"latent": ("float", [latent_size])}


class Perception(Independent):
    """Masks and tool positions in, latents out.

    Args:
        session: ONNX Runtime session of the encoder; None for "log_polar", which has none.
        representation: "log_polar" has features of the mask about the tool (`vision.log_polar`); "tool" shows the
            encoder the mask in the tool's frame, "paper" as the camera sees it.
        window_m: side of the tool's window, m; read for "tool".
        size: pixels along a side of what the encoder takes, or of the camera's mask.
        homography: working plane to camera pixels, (3, 3); not read for "paper".
        threaded: whether threads of its own divide a batch of log-polar features; not for a control loop. `close` ends
            them.

    Attributes:
        latent_size: how many numbers come out.
    """

    def __init__(
        self,
        session: onnxruntime.InferenceSession | None,
        representation: str,
        window_m: float,
        size: int,
        homography: np.ndarray | None,
        threaded: bool = False,
    ):
        if representation not in WITH_IMAGE:
            allowed = ", ".join(WITH_IMAGE)
            raise InvalidInputError(f"representation is {representation!r}; choose one of {allowed}")
        self.session = session
        self.representation = representation
        self.window_m = window_m
        self.size = size
        self.homography = np.array(homography, dtype=np.float64) if representation != "paper" else None
        self.ground = ground_of(self.homography, (size, size)) if representation == "log_polar" else None
        self._threads = Threads(CHUNKS) if threaded and self.ground is not None else None
        self.latent_size = FEATURES if session is None else session.get_outputs()[0].shape[1]

    def __call__(self, masks: np.ndarray, tool_positions: np.ndarray) -> np.ndarray:
        """Encode a batch.

        Args:
            masks: camera masks, (N, height, width, 1) or (N, height, width), uint8, foreground 0.
            tool_positions: (N, 2) or wider, m, world; x and y are read.

        Returns:
            Latents, (N, latent_size) float32.

        Raises:
            InvalidInputError: a shape or type differs.
        """
        if self.ground is not None:
            return log_polar_features(masks, tool_positions, self.ground, self._threads)
        if self.representation == "tool":
            views = rectify(masks, tool_positions, self.homography, self.window_m, self.size)
        else:
            views = np.asarray(masks)
            views = views[..., 0] if views.ndim == 4 else views
            if views.dtype != np.uint8 or views.shape[1:] != (self.size, self.size):
                raise InvalidInputError(
                    f"masks are {views.dtype} of shape {views.shape}; "
                    f"this encoder takes uint8 (N, {self.size}, {self.size})"
                )
        return self._encode(views)

    def _encode(self, views: np.ndarray) -> np.ndarray:
        if self.session is None:
            raise InvalidInputError(f"representation '{self.representation}' needs an encoder, and session is None")
        return self.session.run(["latent"], {"mask": views})[0]

    def close(self) -> None:
        """End the threads."""
        if self._threads is not None:
            self._threads.close()
