try:
    1 / 0
except Exception as e:
    frame = e.__traceback__.tb_frame
    print(frame.f_back.f_globals)
