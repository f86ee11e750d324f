g = (i for i in range(3))
print(g.gi_frame.f_builtins)
