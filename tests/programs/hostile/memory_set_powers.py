s = {0}
while True:
    s = s | {x + len(s) for x in s}
