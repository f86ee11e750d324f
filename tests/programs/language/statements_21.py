if (n:=len('abc'))>2: print(n)
print([y:=1, y+1])
