targets = [[0.4, 0.2, 0.3], [2.0, 0.0, 0.3], [0.5, -0.1, 0.2], [0.4, 0.0, -0.2]]
reached = 0
for t in targets:
    try:
        move_to(t)
        reached += 1
    except MotionError as e:
        print("skipped:", str(e)[:7])
print(f"{reached}/{len(targets)} reached")
