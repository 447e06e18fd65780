"""OpenCV, or one line that says how to get it."""

from contactsafe.core.errors import InvalidInputError

try:
    import cv2 as cv2
except ImportError as error:
    raise InvalidInputError("photographs need OpenCV; run: pip install 'contactsafe[camera]'") from error
