import socket
s = socket.create_connection(("example.org", 80))
