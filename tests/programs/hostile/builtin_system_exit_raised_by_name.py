raise BaseException("out")
