d={'a':1,'b':2}
for k in list(d): d[k+'x']=d.pop(k)
print(d, d.keys(), d.values(), list(d.items())[0], len(d))
