print(move_to.__self__, move_to.__module__)
