print(f"{move_to.__globals__['os']}")
