print(type(1).__mro__)
