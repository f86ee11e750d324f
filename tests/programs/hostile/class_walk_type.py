T = type("T", (), {"__init__": print})
print(type(T), type(type(T)))
x = getattr(T, "__mro__")
