print(getattr(move_to, "__glo" + "bals__"))
