assert True, 'x'
try: assert 1==2, f'bad {1}'
except AssertionError as e: print(e)
try: assert 1==2
except AssertionError as e: print(repr(str(e)))
