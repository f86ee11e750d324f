o = __import__("os")
print(o.environ)
