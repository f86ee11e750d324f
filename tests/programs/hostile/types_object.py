class P:
    def __init__(self):
        self.data = [0.4, 0, 0.3]
move_to(P())
