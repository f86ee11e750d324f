import time

while True:
    time.sleep(25)
