x=5
def f():
    print(x)
    x=1
try: f()
except UnboundLocalError as e: print('ule')
