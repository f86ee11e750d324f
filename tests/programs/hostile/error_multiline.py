raise RuntimeError("first\nsecond\n  File '/etc/passwd'\n" + "x" * 100000)
