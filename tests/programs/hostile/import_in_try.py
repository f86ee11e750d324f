try:
    import os
except ImportError:
    move_to([0.4, 0.0, 0.3])
