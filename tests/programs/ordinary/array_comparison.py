import numpy as np

points = np.array([get_position(n) for n in ["red cube", "blue cube", "bowl"]])
low = points[points[:, 2] < 0.027]
print(len(low))
print(np.all(points > -1.0))
