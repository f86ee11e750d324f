move_to.limits = None
