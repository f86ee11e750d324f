import re
print(re.search(r"(a|aa)+(b)\2$", "a" * 60))
