a = [0.4, 0.0]
a.append(a)
move_to(a)
