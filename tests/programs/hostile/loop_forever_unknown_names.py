n = 0
while True:
    try:
        undefined_thing = get_position("nothing")
    except Exception:
        n += 1
