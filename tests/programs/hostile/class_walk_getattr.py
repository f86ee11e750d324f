t = getattr((), "__class__")
print(t)
