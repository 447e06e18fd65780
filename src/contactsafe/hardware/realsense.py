"""A RealSense camera's colour pictures, taken at sensor level: the newest one counts, and its age is known.

At that level a device made of software is read by the same code as one on a cable.
"""

import contextlib
import functools
import time
from typing import Any

import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import ContactSafeError, InvalidInputError

WIDTH, HEIGHT, RATE_HZ = 1280, 720, 30

AGAIN_S = 1.0
"""A camera that is gone is looked for so often."""


class CameraError(ContactSafeError):
    """The camera cannot be opened."""


@functools.cache
def library() -> Any:
    """Return librealsense's Python library.

    Raises:
        InvalidInputError: it is not installed.
    """
    try:
        import pyrealsense2
    except ImportError:
        raise InvalidInputError(
            "pyrealsense2 is not installed; install contactsafe[realsense] (Debian: libusb-1.0-0 beside it)"
        ) from None
    return pyrealsense2


class ColourCamera(Unique):
    """The colour sensor of a device.

    Args:
        serial: of the device; None for the first one.
        sensor, profile: to be read in place of a device's; as a software device has them.
    """

    _why = "a camera is read once; open another one"

    def __init__(self, serial: str | None = None, sensor: Any = None, profile: Any = None):
        self._library, self._serial = library(), serial
        self._sensor, self._profile = sensor, profile
        self._queue: Any = None
        self._found = ""
        self._picture: np.ndarray | None = None
        self._number, self._arrived, self._tried = -1, time.monotonic(), -AGAIN_S

    def open(self) -> None:
        """Begin to take pictures.

        Raises:
            CameraError: there is no such camera, or it has no such pictures.
        """
        if self._sensor is None:
            self._sensor, self._profile = self._find()
        self._queue = self._library.frame_queue(1)
        try:
            self._sensor.open(self._profile)
            self._sensor.start(self._queue)
        except RuntimeError as error:
            raise CameraError(f"the camera does not start: {error}; is another program using it?") from None
        self._arrived = time.monotonic()

    def _find(self) -> tuple[Any, Any]:
        devices = [
            device
            for device in self._library.context().query_devices()
            if self._serial in (None, device.get_info(self._library.camera_info.serial_number))
        ]
        if not devices:
            which = "no RealSense camera" if self._serial is None else f"no RealSense camera {self._serial}"
            raise CameraError(f"{which} is connected; check the cable (USB 3), or name another with --camera SERIAL")
        for sensor in devices[0].query_sensors():
            for profile in sensor.get_stream_profiles():
                if self._is_wanted(profile):
                    self._found = devices[0].get_info(self._library.camera_info.serial_number)
                    return sensor, profile
        raise CameraError(f"the camera has no colour pictures of {WIDTH} × {HEIGHT} at {RATE_HZ} Hz; use USB 3")

    def _is_wanted(self, profile: Any) -> bool:
        if profile.stream_type() != self._library.stream.color or profile.format() != self._library.format.rgb8:
            return False
        video = profile.as_video_stream_profile()
        return (video.width(), video.height(), profile.fps()) == (WIDTH, HEIGHT, RATE_HZ)

    @property
    def intrinsics(self) -> Any:
        """Of the pictures, as the device knows them."""
        return self._profile.as_video_stream_profile().intrinsics

    @property
    def serial(self) -> str:
        """Of the device that was opened; what was asked for where a software device is read."""
        return self._found or self._serial or ""

    def newest(self, wait_ms: int = 0) -> tuple[np.ndarray | None, int, float]:
        """Return the newest picture, its number, and for how long none has come, ms.

        Args:
            wait_ms: for a picture, if none has come since the last call.

        Returns:
            uint8 (720, 1280, 3), None before the first one; the number as the device counts, −1 before it.
        """
        frame = self._queue.poll_for_frame() if self._queue is not None else None
        if not frame and wait_ms and self._queue is not None:
            try:
                frame = self._queue.wait_for_frame(wait_ms)
            except RuntimeError:
                frame = None
        if frame:
            self._picture, self._number = np.asarray(frame.get_data()), frame.get_frame_number()
            self._arrived = time.monotonic()
        return self._picture, self._number, 1000.0 * (time.monotonic() - self._arrived)

    def look_again(self) -> bool:
        """Try to open a camera that is gone, once a second at most; tell whether it is back."""
        now = time.monotonic()
        if now - self._tried < AGAIN_S:
            return False
        self._tried = now
        self.close()
        self._sensor = self._profile = None
        try:
            self.open()
        except CameraError:
            return False
        return True

    def close(self) -> None:
        """Take no more pictures."""
        if self._sensor is not None and self._queue is not None:
            for end in (self._sensor.stop, self._sensor.close):
                with contextlib.suppress(RuntimeError):  # it is gone
                    end()
        self._queue = self._picture = None  # what was seen before is no picture of a camera that is opened again


class SoftwareCamera(Unique):
    """A device made of software, with the colour pictures of a RealSense D455 that somebody gives it.

    Args:
        fx, fy, cx, cy: of its lens, pixels.
        distortion: k1, k2, p1, p2, k3.
    """

    _why = "a software device belongs to one process; make another one"

    def __init__(self, fx: float, fy: float, cx: float, cy: float, distortion: tuple[float, ...]):
        rs = library()
        self._device = rs.software_device()
        self.sensor = self._device.add_sensor("Color")
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = rs.stream.color, 0, 1, rs.format.rgb8
        stream.width, stream.height, stream.fps, stream.bpp = WIDTH, HEIGHT, RATE_HZ, 3
        lens = rs.intrinsics()
        lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy = WIDTH, HEIGHT, fx, fy, cx, cy
        lens.model, lens.coeffs = rs.distortion.brown_conrady, list(distortion)
        stream.intrinsics = lens
        self.profile = self.sensor.add_video_stream(stream)

    def give(self, picture: np.ndarray, number: int, milliseconds: float) -> None:
        """Hand a picture in, uint8 (720, 1280, 3), with its number and time."""
        rs = library()
        frame = rs.software_video_frame()
        frame.pixels, frame.stride, frame.bpp = np.ascontiguousarray(picture), 3 * WIDTH, 3
        frame.timestamp, frame.domain, frame.frame_number = milliseconds, rs.timestamp_domain.hardware_clock, number
        frame.profile = self.profile.as_video_stream_profile()
        self.sensor.on_video_frame(frame)
