wait(seconds=30.5)
