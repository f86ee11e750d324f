import numpy as np


def rot_z(theta):
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


pivot = np.array([0.6, 0.3, 0.15])
handle = np.array(get_position("cabinet handle"))
path = []
for theta in np.linspace(0, -np.pi / 4, 12):
    path.append((rot_z(theta) @ (handle - pivot) + pivot).tolist())
follow_path(path)
R = rot_z(np.pi / 2)
print(np.round(R @ R.T, 6).tolist(), R.shape, np.round(np.linalg.det(R), 6))
