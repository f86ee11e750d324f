print(str(10**100000))
