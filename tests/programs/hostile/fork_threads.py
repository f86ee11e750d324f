import threading
threading.Thread(target=go_home).start()
