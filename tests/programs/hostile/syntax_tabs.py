if True:
	go_home()
        go_home()
