password = input("sudo password: ")
