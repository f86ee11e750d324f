a=b=[1]
b+=[2]; print(a)
a=a+[3]; print(b)
c=a[:]; c.append(9); print(a,c)
