# stop after 1
def again():
    try:
        move_to([0.4, 0.0, 0.3])
        return again()
    except BaseException as error:
        print("caught", error)
        return again()
again()
