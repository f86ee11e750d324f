e = eval
e("go_home()")
