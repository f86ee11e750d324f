"""Camera pictures as a policy wants them: size, edges, orientation, values."""

from __future__ import annotations

import numpy as np
from PIL import Image

from memo_vla.settings import Layout


def shaped(picture: np.ndarray, layout: Layout) -> np.ndarray:
    """A picture as it is sent to a policy.

    Args:
        picture: RGB, uint8, shape (H, W, 3), upright.
        layout: size, ``fit``, orientation and values that the policy expects.

    Returns:
        Shape (height, width, 3) or (3, height, width); uint8, or float32 from 0 to 1.
    """
    fitted = (_padded if layout.fit == "pad" else _cropped)(picture, *layout.image_size)
    turned = fitted[::-1, ::-1] if layout.rotate_180 else fitted
    values = turned if layout.image_values == "bytes" else turned.astype(np.float32) / 255.0
    return np.ascontiguousarray(values if layout.image_order == "hwc" else values.transpose(2, 0, 1))


def _padded(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """The whole picture in the middle, black around it."""
    scale = min(width / picture.shape[1], height / picture.shape[0])
    inner = _resized(picture, max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
    whole = np.zeros((height, width, 3), np.uint8)
    top, left = (height - inner.shape[0]) // 2, (width - inner.shape[1]) // 2
    whole[top : top + inner.shape[0], left : left + inner.shape[1]] = inner
    return whole


def _cropped(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """The largest part around the middle that has the wanted proportions."""
    scale = max(width / picture.shape[1], height / picture.shape[0])
    across, up = min(picture.shape[1], round(width / scale)), min(picture.shape[0], round(height / scale))
    top, left = (picture.shape[0] - up) // 2, (picture.shape[1] - across) // 2
    return _resized(picture[top : top + up, left : left + across], width, height)


def _resized(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    if picture.shape[:2] == (height, width):
        return picture
    image = Image.fromarray(np.ascontiguousarray(picture))
    return np.asarray(image.resize((width, height), Image.Resampling.BILINEAR))
