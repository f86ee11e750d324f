print("\ud800")
get_position("\udfff")
