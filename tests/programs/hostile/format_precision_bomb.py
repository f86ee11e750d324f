print(len(f"{1.0:.999999999f}"))
