def open_door_twice(name, stuck, angle=math.radians(88)):
    # to where it sticks, a little back, and all the way
    door = read_door(name)
    first, back, rest = arc(door, 0.0, stuck + 0.08), arc(door, stuck + 0.08, stuck - 0.1), arc(door, stuck - 0.1, angle)
    away = at_angle(door, angle, 0.0, 0.12)
    grasp_bar(door, first + back + rest + [away])
    follow_path(first, then=back + rest + [away])
    follow_path(back, then=rest + [away])
    follow_path(rest, then=[away])
    let_go(away)
