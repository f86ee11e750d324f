o = getattr
f = [x for x in [print]][0]
import pathlib
print(pathlib.Path("/etc/passwd").read_text())
