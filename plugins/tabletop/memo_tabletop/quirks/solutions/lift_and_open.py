def lift_and_open(name, angle=math.radians(88), lift=0.026):
    door = read_door(name)
    raised = at_angle(door, 0.0, lift)
    way = arc(door, 0.0, angle, lift)
    away = at_angle(door, angle, lift, 0.12)
    grasp_bar(door, [raised] + way + [away])
    follow_path([raised], then=way + [away])
    follow_path(way, then=[away])
    let_go(away)
