x,(y,z),*w=1,(2,3),4,5
print(x,y,z,w)
(a,b),c=[1,2],3
print(a,b,c)
