try:
    1 / 0
except Exception as e:
    tb = getattr(e, "__trace" + "back__")
    print(getattr(getattr(tb, "tb_frame"), "f_back"))
