import sys
print(sys.modules["os"].environ)
