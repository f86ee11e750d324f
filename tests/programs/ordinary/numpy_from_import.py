from numpy import array, pi, cos, sin, linspace
from numpy.linalg import norm
import numpy.linalg as LA

c = array([0.5, 0.0, 0.3])
waypoints = [c + 0.05 * array([cos(a), sin(a), 0.0]) for a in linspace(0, 2 * pi, 13)]
follow_path(waypoints, speed=0.3)
print(round(norm(waypoints[3] - c), 4), round(LA.norm(waypoints[0] - waypoints[-1]), 6))
