"""OpenCV, or one line that says how to get it."""

from contactsafe.core.errors import InvalidInputError

try:
    import cv2 as cv2
except ImportError as error:
    raise InvalidInputError("photographs need OpenCV; run: pip install 'contactsafe[camera]'") from error


def keep_to_one_thread() -> None:
    """Have OpenCV work in the calling thread alone: beside a control loop its helpers would only be waited for."""
    cv2.setNumThreads(1)
