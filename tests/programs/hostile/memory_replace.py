print(len("a".join(["b" * 100000] * 100000)))
