def open_near_hinge(name, angle=math.radians(85)):
    door = read_door(name, True)
    way = arc(door, 0.0, angle)
    away = at_angle(door, angle, 0.0, 0.10)
    grasp_bar(door, way + [away])
    follow_path(way, then=[away])
    let_go(away)
