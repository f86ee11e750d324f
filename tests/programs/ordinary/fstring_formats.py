p = get_position("red cube")
print(f"Position: ({p[0]:.3f}, {p[1]:+.2f}, {p[2]:>8.4f})")
print(f"{'name':<12}{'x':>8}")
for n in ["red cube", "bowl"]:
    print(f"{n:<12}{get_position(n)[0]:>8.2f}")
print("%s is %.1f cm wide" % ("red cube", get_size("red cube")[0] * 100))
print("{} {:.2f}".format("bowl", get_size("bowl")[1]), f"{is_holding()!r:>6}", sep=" | ")
value = 0.123456
print(f"{value = :.3f}")
