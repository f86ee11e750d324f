d={}
d[1,2]=3; d['a']={'b':[1]}
d['a']['b'][0]+=5
print(d, (1,2) in d)
del d[1,2]
print(d)
