move_to("up")
