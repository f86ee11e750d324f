def logged(f):
    def wrapper(*args, **kwargs):
        print("->", f.__name__)
        result = f(*args, **kwargs)
        print("<-", result)
        return result
    return wrapper


@logged
def approach(name, height=0.1):
    p = get_position(name)
    move_to([p[0], p[1], p[2] + height])
    return round(p[2] + height, 3)


approach("red cube", height=0.2)
