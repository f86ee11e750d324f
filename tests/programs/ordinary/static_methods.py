class Geometry:
    @staticmethod
    def lerp(a, b, t):
        return [p + (q - p) * t for p, q in zip(a, b)]

    @property
    def home(self):
        return [0.4, 0.0, 0.4]


g = Geometry()
move_to(Geometry.lerp(g.home, get_position("red cube"), 0.5))
print("lerped")
