class A:
    n=0
    items=[]
    def inc(self): self.n+=1; A.n+=10; self.items.append(1); return self
a=A().inc().inc(); b=A(); print(a.n,b.n,A.n,b.items)
