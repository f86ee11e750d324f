class GraspError(Exception):
    pass


def grasp(name):
    move_to(get_position(name))
    if close_gripper() < 0.005:
        raise GraspError(f"nothing grasped at {name}")


try:
    grasp("bowl")
except GraspError as e:
    print("grasp failed:", e)
