"""Pictures as files."""

from pathlib import Path

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.files import write_whole
from contactsafe.vision.opencv import cv2


def read_picture(path: Path) -> np.ndarray:
    """Read a PNG or JPEG, uint8 (height, width, 3), red, green and blue.

    Raises:
        InvalidInputError: there is no such file, or it is no picture.
    """
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror or error}; give a PNG or JPEG") from None
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) if data.size else None
    except cv2.error:
        picture = None
    if picture is None:
        raise InvalidInputError(f"{path.name} is no picture; give a PNG or JPEG")
    return picture


def write_picture(path: Path, picture: np.ndarray) -> None:
    """Write a picture, uint8 (height, width, 3), as PNG, whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    write_whole(path, cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes())
