from dataclasses import dataclass, field
from typing import List, Optional


@dataclass
class Grasp:
    name: str
    position: List[float]
    yaw: float = 0.0
    force: Optional[float] = None


@dataclass
class Plan:
    grasps: List[Grasp] = field(default_factory=list)

    def add(self, g: Grasp) -> "Plan":
        self.grasps.append(g)
        return self


plan = Plan()
plan.add(Grasp("red cube", get_position("red cube"))).add(Grasp("blue cube", get_position("blue cube"), yaw=0.3, force=20))
for g in plan.grasps:
    move_to([g.position[0], g.position[1], g.position[2] + 0.1], top_orientation(g.yaw))
    print(f"{g.name:<10}|{g.yaw:5.2f}|{g.force}")
