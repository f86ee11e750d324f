import re
print(re.match("(a+)+$", "a" * 5000 + "b"))
