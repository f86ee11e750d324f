from __future__ import annotations
from typing import Dict, List, Optional, Tuple, Union

Vector = Tuple[float, float, float]


def centre(names: List[str]) -> Vector:
    xs: List[float] = [get_position(n)[0] for n in names]
    ys: List[float] = [get_position(n)[1] for n in names]
    zs: List[float] = [get_position(n)[2] for n in names]
    return (sum(xs) / len(xs), sum(ys) / len(ys), sum(zs) / len(zs))


def nearest(point: Vector, candidates: Dict[str, List[float]]) -> Optional[str]:
    best: Optional[str] = None
    best_d: Union[float, None] = None
    for name, p in candidates.items():
        d = sum((a - b) ** 2 for a, b in zip(point, p))
        if best_d is None or d < best_d:
            best, best_d = name, d
    return best


c = centre(["red cube", "blue cube"])
move_to((c[0], c[1], c[2] + 0.15))
print(nearest(c, {n: get_position(n) for n in get_objects()}))
