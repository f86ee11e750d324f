print(vars(), dir())
