import numpy as np

names = ["red cube", "blue cube", "bowl"]
P = np.array([get_position(n) for n in names])
centre = P.mean(axis=0)
offsets = P - centre
print(P.shape, np.round(centre, 3), np.round(np.linalg.norm(offsets, axis=1), 3))
order = np.argsort(P[:, 0])
for i in order:
    print(names[i], P[i, 0])
    move_to(P[i] + np.array([0, 0, 0.2]))
grid = np.vstack([P, centre])
print(len(grid), np.max(grid[:, 2]), np.concatenate([centre[:2], [0.3]]).shape)
