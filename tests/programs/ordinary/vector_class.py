class Vec:
    def __init__(self, x, y, z):
        self.x, self.y, self.z = x, y, z

    def __add__(self, other):
        return Vec(self.x + other.x, self.y + other.y, self.z + other.z)

    def __mul__(self, k):
        return Vec(self.x * k, self.y * k, self.z * k)

    def __repr__(self):
        return f"Vec({self.x:.2f}, {self.y:.2f}, {self.z:.2f})"

    def as_list(self):
        return [self.x, self.y, self.z]


p = Vec(*get_position("bowl")) + Vec(0, 0, 1) * 0.2
move_to(p.as_list())
print(p)
