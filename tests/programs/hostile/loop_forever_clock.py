import time
while time.time() < 1e9:
    pass
