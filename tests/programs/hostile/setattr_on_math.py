import math
math.pi = 3
move_to([0.4, 0.0, math.pi])
