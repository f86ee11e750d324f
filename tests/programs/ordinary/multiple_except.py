def attempt(f):
    try:
        return f()
    except (KeyError, IndexError) as e:
        return type(e).__name__
    except ZeroDivisionError:
        return "zero"
    except RuntimeError as e:
        return "motion"
    except Exception as e:
        return "other: " + type(e).__name__


print(attempt(lambda: {}["a"]), attempt(lambda: [][0]), attempt(lambda: 1 / 0))
print(attempt(lambda: move_to([0.1, 0.0, 5.0])), attempt(lambda: int("x")), attempt(lambda: 3))
