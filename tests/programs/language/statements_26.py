s={3,1,2}
s.add(5); s.discard(9); s.update([7])
print(sorted(s), len(s), s=={1,2,3,5,7})
