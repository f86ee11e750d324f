class Speed:
    def __init__(self, value):
        self.value = value

    def __enter__(self):
        return self.value

    def __exit__(self, *exc):
        return False


with Speed(0.3) as s:
    move_straight([0.4, 0.1, 0.3], speed=s)
print("slow", s)
