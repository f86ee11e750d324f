import numpy as np
move_to(np.array([0.4, 0, 0.3]) * 100)
