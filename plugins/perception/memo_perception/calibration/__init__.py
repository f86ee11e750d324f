"""Where cameras are: hand-eye calibration with a ChArUco board, its file, and checks of it with tags."""
