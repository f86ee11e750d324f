"""Regions: pieces of the scene that geometry and colour tell apart before anything has a name."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.plugin import Array


@attrs.frozen(eq=False)
class Region:
    """One piece: its points in the base frame and its pixels in each frame."""

    id: int  # from 1, unique in a look; the number drawn on the picture for set-of-marks
    points: Array  # (N, 3) metres, base frame, fused over the frames
    colours: np.ndarray  # (N, 3) uint8 sRGB, of the points
    masks: dict[str, np.ndarray] = attrs.field(factory=dict)  # frame name -> (H, W) bool
    size: tuple[float, float, float] | None = None  # m, full extents, as if it were one thing; None: not measured
    deviation: float = 0.0  # m, standard deviation of each extent
    uncovered: float = 0.0  # share of its outline that nothing covers, in the picture that shows most of it

    @property
    def centre(self) -> Array:
        """Median of the points, shape (3,)."""
        return np.median(self.points, axis=0)
