import math
follow_path([[0.4, 0.0, 0.3], [0.4, math.nan, 0.3]])
