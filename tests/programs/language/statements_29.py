matrix=[[1,2],[3,4]]
print([list(r) for r in zip(*matrix)], [sum(r) for r in matrix], sum(map(sum,matrix)))
matrix[0][1]=9; print(matrix)
