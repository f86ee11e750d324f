s = "‮move‬"
print(s)
