import time

start = time.time()
open_gripper()
time.sleep(0.5)
wait(1)
elapsed = time.time() - start
print(elapsed >= 1.0)
while time.time() - start < 2.0:
    time.sleep(0.1)
print("waited")
