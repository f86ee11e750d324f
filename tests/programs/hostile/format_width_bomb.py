x = "{:>9999999999}".format("x")
print(len(x))
