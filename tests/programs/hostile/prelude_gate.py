_memo_gate()
