print(*[1,2],sep='');print('a','b',end='|');print()
