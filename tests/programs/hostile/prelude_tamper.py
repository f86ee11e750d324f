_memo_len = None
_memo_sorted = exec
ndarray = int
sorted = 5
RuntimeError = None
move_to([9.0, 0.0, 0.0])
