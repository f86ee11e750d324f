class Arm:
    speed = 0.6

    def __init__(self, approach=0.1):
        self.approach = approach
        self.log = []

    def over(self, name, height=None):
        p = get_position(name)
        h = self.approach if height is None else height
        move_to([p[0], p[1], p[2] + h], top_orientation(), speed=self.speed)
        self.log.append(f"over {name}")
        return self

    def down(self, name):
        move_straight(get_position(name))
        self.log.append("down")
        return self

    def grab(self):
        close_gripper()
        return is_holding()


arm = Arm(approach=0.12)
held = arm.over("red cube").down("red cube").grab()
print(held, arm.log)
