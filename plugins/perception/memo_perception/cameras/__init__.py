"""Scene graphs from RGB-D pictures: sources of frames, detectors that name what is seen, geometry that measures it."""
