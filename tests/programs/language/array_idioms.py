import numpy as np
a=np.array([1.,2.,3.])
print(1<2<3, a.shape[0]<4, 'a'<'b', [1]<[2], (a<2).tolist(), bool((a>0).all()), sum(a>1), 1 if a[0]<2 else 0)
if np.linalg.norm(a)<10 and a[2]>=3: print('ok')
while a[0]<5: a[0]+=1
print(a[0], [v for v in a if v>2], max(a), len(a), list(a), a.tolist(), sum(a), min(*a), sorted(a), [x+1 for x in a])
x,y,z=a; print(x,y,z); print(tuple(a), {'p':a.tolist()}, a is not None, a.size, float(a[1]), int(a[2]))
b=a.copy(); b[0]=-1; print(a[0], float(b[0]), (a-b).tolist(), (a*[1,2,3]).tolist(), (a/2).tolist(), a.dtype is not None)
for i,v in enumerate(a): print(i,float(v),end=' ')
pts=[np.array([i,0,0]) for i in range(3)]; print(np.array(pts).shape, np.mean(pts,axis=0).tolist(), sum(pts).tolist())
print(isinstance(a,np.ndarray), isinstance(a,list), type(a).__name__, np.isclose(0.1+0.2,0.3), np.pi>3, np.sqrt(4.0), np.abs(-3), np.deg2rad(180)>3.14)
