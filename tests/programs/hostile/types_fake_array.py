class ndarray:
    def __init__(self):
        self.data = "boom"
move_to(ndarray())
