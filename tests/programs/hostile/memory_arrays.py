import numpy as np
x = np.zeros((10000, 10000))
