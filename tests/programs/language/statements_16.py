s='abc'
for ch in s: print(ch,end=' ')
print()
for a,b in [(1,2),(3,4)]: print(a+b)
for k,v in {'a':1}.items(): print(k,v)
