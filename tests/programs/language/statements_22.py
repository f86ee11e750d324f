x=[3,1,2]; print(x.sort(), x, sorted(x,key=lambda v:-v)); x.reverse(); print(x); x.insert(0,9); x.extend([1]); print(x.pop(), x.pop(0), x); x.clear(); print(x)
