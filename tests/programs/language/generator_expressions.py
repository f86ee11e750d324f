names=['a','bb','ccc']
print(next(n for n in names if len(n)>1), next((n for n in names if len(n)>5), 'none'))
try: next(n for n in names if len(n)>5)
except StopIteration: print('stop')
print(all(len(n)>0 for n in names), any(n=='bb' for i,n in enumerate(names)), any(x*y==6 for x in [1,2] for y in [3,4]))
print(any(n for n in names if n=='zz'), all(n for n in []), sum(len(n) for n in names), sorted((len(n),n) for n in names)[0])
print(set(n[0] for n in names)=={'a','b','c'}, dict((n,len(n)) for n in names), list(n for n in names), tuple(n for n in names), ''.join(n for n in names))
def first(it): return next(iter(it))
print(first(n for n in names))
g=(n for n in names); print(next(g), next(g), list(g))
def outer(k): return any(n.startswith(k) for n in names)
print(outer('c'), [outer(k) for k in 'xyza'])
class A:
    def __init__(self): self.copy='data'; self.index=3
    def get(self): return self.index
a=A(); print(a.copy, a.index, a.get(), [a.get][0]())
m=max(names,key=len); print(m, min(names,key=lambda n:-len(n)), sorted(names,key=lambda n:(-len(n),n)), list(filter(None,[0,1])), list(map(len,names)))
