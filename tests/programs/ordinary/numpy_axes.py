import numpy as np

axes = np.array(get_axes("blue cube"))
x_axis = axes[0]
yaw = np.arctan2(x_axis[1], x_axis[0])
low, high = map(np.array, get_bounds("blue cube"))
extent = high - low
print(axes.shape, round(float(yaw), 3), np.argmax(extent) in (0, 1), np.round(extent.max(), 3), extent[:2].sum() > 0.1)
move_to(np.append((low + high)[:2] / 2, high[2] + 0.1), top_orientation(float(yaw)))
